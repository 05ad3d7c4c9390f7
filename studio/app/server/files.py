"""Answers that are files: pictures, and downloads under a name."""

from fastapi import Response

CSV = "text/csv; charset=utf-8"
BINARY = "application/octet-stream"


def picture(content: bytes, kind: str = "jpeg", *, revalidated: bool = False) -> Response:
    """A picture that is not kept by the browser; revalidated : that is, and asked for again if it has changed."""
    headers = {"cache-control": "no-cache" if revalidated else "no-store"}
    return Response(content, media_type=f"image/{kind}", headers=headers)


def download(content: bytes | str, name: str, media_type: str, **headers: str) -> Response:
    """A file to be saved as `name`. headers : more of them, with _ for -."""
    more = {key.replace("_", "-"): value for key, value in headers.items()}
    disposition = f'attachment; filename="{name}"'
    return Response(content, media_type=media_type, headers={"content-disposition": disposition, **more})
