"""What can be wrong with an arm or with what is asked of it."""

from __future__ import annotations

from handover_dmp.errors import DataError


class RobotDescriptionError(DataError):
    """A robot description that cannot be used; names the file and what it lacks."""


class UnreachableError(DataError):
    """
    A wrist pose, or a path, that the arm cannot reach.

    Attributes:
        missing_m: how far the nearest point in reach is from the one asked for, m.

    """

    def __init__(self, message: str, missing_m: float) -> None:
        super().__init__(message)
        self.missing_m = missing_m
