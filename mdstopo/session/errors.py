"""What can stop a run from outside."""


class WorkerError(Exception):
    """A worker process ended before its work was done; the message is a sentence for the user."""

    exit_status = 1


class NoUtopiaError(Exception):
    """An objective alone cannot be optimised, so that several cannot be combined."""

    exit_status = 1
