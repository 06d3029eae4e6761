"""Errors that a user can act on: one clear line each, and the exit code that goes with it."""


class HandoverError(Exception):
    """
    Base of every error that this package raises on purpose.

    The message is one line that names what is wrong and where. The command line prints it without
    a traceback and exits with `exit_code`.
    """

    exit_code = 1


class DataError(HandoverError):
    """A file or a message holds something that cannot be used; names file, line and fault."""


class UsageError(HandoverError):
    """The request itself makes no sense: unknown option, missing file name, wrong combination."""

    exit_code = 2
