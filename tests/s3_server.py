"""A server that speaks S3, with a bucket, and what a process needs in its environment to use it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import boto3
import pytest
import s3fs
from moto.server import ThreadedMotoServer

from studio.sessions import remote_sessions

BUCKET = "footage"
CREDENTIALS = {
    "AWS_ACCESS_KEY_ID": "tester",
    "AWS_SECRET_ACCESS_KEY": "secret",
    "AWS_DEFAULT_REGION": "us-east-1",
}


@contextmanager
def s3_server() -> Iterator[Mapping[str, str]]:
    """A server on a free port of this machine; yields the environment variables of its address and credentials."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        endpoint = f"http://{host}:{port}"
        boto3.client(
            "s3",
            endpoint_url=endpoint,
            aws_access_key_id=CREDENTIALS["AWS_ACCESS_KEY_ID"],
            aws_secret_access_key=CREDENTIALS["AWS_SECRET_ACCESS_KEY"],
            region_name=CREDENTIALS["AWS_DEFAULT_REGION"],
        ).create_bucket(Bucket=BUCKET)
        yield {**CREDENTIALS, "AWS_ENDPOINT_URL": endpoint}
    finally:
        server.stop()


@contextmanager
def used_here(variables: Mapping[str, str], monkeypatch: pytest.MonkeyPatch, cache: Path) -> Iterator[None]:
    """This process uses the server, with a cache of its own; at the end it holds no session of it."""
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("STUDIO_CACHE", str(cache))
    # Connections are kept by what they were opened with, which is not all of the environment.
    s3fs.S3FileSystem.clear_instance_cache()
    yield
    while remote_sessions._holds:
        remote_sessions._holds.popitem()[1].free()
