"""Errors with a cause and a remedy.

Every error that a user can cause is a `StudioError`: `message` says what is wrong and where (naming the thing
and the value), `hint` says what to do. Commands print both and exit with 2; the server answers with `status`.
"""


class StudioError(Exception):
    """A one-sentence cause and a one-sentence remedy.

    message : what is wrong and where, one sentence. hint : what to do, one sentence.
    """

    status = 400
    code = "error"

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} {self.hint}".strip()


class SettingsError(StudioError):
    """An unknown setting, or a value outside its range."""

    status, code = 422, "settings"


class BodyError(StudioError):
    """A body file, subject file or pose that does not describe a body."""

    status, code = 422, "body"


class CalibrationError(StudioError):
    """A calibration that cannot be read or would place cameras wrongly."""

    status, code = 422, "calibration"


class FootageError(StudioError):
    """Pictures or videos that are missing, damaged or do not fit their calibration."""

    status, code = 422, "footage"


class SessionError(StudioError):
    """A session, run or result that cannot be found, read or written."""

    status, code = 409, "session"


class NotFoundError(SessionError):
    """A session, run, frame or layer that does not exist."""

    status, code = 404, "not-found"


class DamagedError(NotFoundError):
    """A damaged stored frame: a gap, until it is tracked again."""

    code = "damaged"


class TruthError(StudioError):
    """A TRC or other reference motion that cannot be used."""

    status, code = 422, "truth"


class RunError(StudioError):
    """A run that cannot start or go on."""

    status, code = 409, "run"


class AccessError(StudioError):
    """A request without the token's cookie, from a foreign host or origin."""

    status, code = 403, "access"


class BehaviourError(StudioError):
    """A behaviour model that cannot be learnt, read or used with this body."""

    status, code = 422, "behaviour"


class UnforeseenError(StudioError):
    """A fault of the studio itself."""

    status, code = 500, "unforeseen"


class WorkCancelledError(StudioError):
    """Long work that the caller cancelled; nothing of it is kept."""

    status, code = 409, "cancelled"


class ExportError(StudioError):
    """An export that cannot be made, or that differs when it is read back."""

    status, code = 422, "export"
