"""Errors with a cause and a remedy.

Every error that a user can cause is a `StudioError`: `message` says what is wrong and where (naming the thing
and the value), `hint` says what to do. Commands print both and exit with 2; the server answers with `status`, which a
class names with its `code`, or has of its base.
"""


class StudioError(Exception):
    """A one-sentence cause and a one-sentence remedy.

    message : what is wrong and where, one sentence.
    hint : what to do, one sentence.
    """

    status = 400
    code = "error"

    def __init_subclass__(cls, status: int | None = None, code: str = "") -> None:
        cls.status, cls.code = status or cls.status, code or cls.code

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} {self.hint}".strip()


class SettingsError(StudioError, status=422, code="settings"):
    """An unknown setting, or a value outside its range."""


class BodyError(StudioError, status=422, code="body"):
    """A body file, subject file or pose that does not describe a body."""


class CalibrationError(StudioError, status=422, code="calibration"):
    """A calibration that cannot be read or would place cameras wrongly."""


class FootageError(StudioError, status=422, code="footage"):
    """Pictures or videos that are missing, damaged or do not fit their calibration."""


class SessionError(StudioError, status=409, code="session"):
    """A session, run or result that cannot be found, read or written."""


class NotFoundError(SessionError, status=404, code="not-found"):
    """A session, run, frame or layer that does not exist."""


class DamagedError(NotFoundError, code="damaged"):
    """A damaged stored frame: a gap, until it is tracked again."""


class TruthError(StudioError, status=422, code="truth"):
    """A TRC or other reference motion that cannot be used."""


class NoPointsError(TruthError):
    """A table that has no points: something else, such as a robot's angles."""


class RunError(StudioError, status=409, code="run"):
    """A run that cannot start or continue."""


class AccessError(StudioError, status=403, code="access"):
    """A request without the token's cookie, from a foreign host or origin."""


class BehaviourError(StudioError, status=422, code="behaviour"):
    """A behaviour model that cannot be learnt, read or used with this body."""


class UnforeseenError(StudioError, status=500, code="unforeseen"):
    """A fault of the studio itself."""


class WorkCancelledError(StudioError, status=409, code="cancelled"):
    """Long work that the caller cancelled; nothing of it is kept."""


class ExportError(StudioError, status=422, code="export"):
    """An export that cannot be made, or that differs when it is read back."""
