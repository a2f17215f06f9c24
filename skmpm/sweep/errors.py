"""What refuses a sweep, and what ends a member early."""


class SweepError(ValueError):
    """A sweep that cannot be run as asked: names the member or the object, and the remedy."""


class InUse(SweepError):  # noqa: N818  (says what is the case, as `StepFailed` does)
    """A directory in which another run is under way."""


class Interrupted(BaseException):
    """Ends a member between two steps or, raised by a signal, in one; no error, so that none handles it as one."""
