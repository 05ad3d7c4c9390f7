"""The API's own description, to make types of: `python -m studio.app.server.api_document` prints it."""

import json
import sys

from studio.app.server.app import ROUTES, Application


def api_document() -> dict[str, object]:
    """The OpenAPI document of every route, without a studio that serves them."""
    return Application(title="Capture studio", routes=ROUTES).openapi()


if __name__ == "__main__":
    json.dump(api_document(), sys.stdout)
