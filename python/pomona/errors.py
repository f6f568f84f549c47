"""The one kind of error a user can cause: wrong input, told in one line."""


class PomonaError(Exception):
    """Wrong input or failed I/O.

    The message is one line that names the file, the field or line, what was found and what was expected.
    The command line prints it to stderr and exits with 2.
    """


class PomonaWarning(UserWarning):
    """Input that can be read but is probably not what was meant; one line, printed to stderr by the command line."""
