"""The API's own description, for whoever makes types of it: `python -m studio.server.api_document` prints it."""

import json
import sys

from fastapi import FastAPI

from studio.server.app import ROUTERS


def api_document() -> dict[str, object]:
    """The OpenAPI document of every route, without a studio that serves them."""
    app = FastAPI(title="Capture studio")
    for router in ROUTERS:
        app.include_router(router)
    return app.openapi()


if __name__ == "__main__":
    json.dump(api_document(), sys.stdout)
