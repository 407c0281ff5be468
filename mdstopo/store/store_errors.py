"""What can go wrong with a result file, each a sentence for the user."""


class StoreError(Exception):
    """A result file cannot be used as asked: the message is a sentence that says why."""

    exit_status = 2


class DamagedError(StoreError):
    """The file is no result of this program, or not a whole one."""


class UnfinishedError(StoreError):
    """The file holds an unfinished run, and neither resuming nor overwriting was asked for."""


class DifferentCaseError(StoreError):
    """The run in the file was made from a case that differs in more than resuming allows.

    `keys` are the paths of the keys that differ.
    """

    def __init__(self, message: str, keys: tuple[str, ...]) -> None:
        super().__init__(message)
        self.keys = keys


class InUseError(StoreError):
    """Another process is writing this file. `pid` and `host` name it where they are known."""

    def __init__(self, message: str, pid: int | None, host: str | None) -> None:
        super().__init__(message)
        self.pid = pid
        self.host = host


class WriteError(StoreError):
    """The file could not be written (a full disk, a directory that is gone)."""

    exit_status = 1


class UnreadableError(StoreError):
    """What was just written cannot be read again: a run that went on would be lost."""

    exit_status = 1
