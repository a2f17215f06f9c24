// Hollow rubber seal, lengths in mm: a flat foot and a round cavity under a wall 1.3 mm thick.
SetFactory("OpenCASCADE");
Rectangle(1) = {-5, 0, 0, 10, 5};
Disk(2) = {0, 5, 0, 5};
BooleanUnion(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Disk(4) = {0, 5.2, 0, 3.5};
BooleanDifference(5) = { Surface{3}; Delete; }{ Surface{4}; Delete; };
Physical Surface("rubber") = {5};
Mesh.MeshSizeMax = 0.35;
Mesh.MeshSizeMin = 0.35;
Mesh.ElementOrder = 1;
