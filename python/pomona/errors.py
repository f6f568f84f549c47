"""The one kind of error a user can cause: wrong input, told in one line."""


class PomonaError(Exception):
    """Wrong input or failed I/O.

    The message is one line that names the file, the field or line, what was found and what was expected.
    The command line prints it to stderr and exits with 2.
    """
