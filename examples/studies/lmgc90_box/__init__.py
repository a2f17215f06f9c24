"""Steel discs in a box under a lid at 10 m/s: the deformable discs of LMGC90's examples."""
