"""Servers of a folder: one in this process, nginx where it is installed, and S3 as moto plays it."""

import hashlib
import os
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from time import monotonic, sleep
from urllib.parse import unquote, urlsplit

import pytest

from tests.fault_proxy import running

NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
needs_nginx = pytest.mark.skipif(NGINX is None, reason="nginx is not installed (Debian: nginx-light)")
PATIENCE = 20.0
"""Seconds that a server may take to start."""
KEYS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}
CONF = """
daemon off; master_process off; worker_processes 1; pid {tmp}/nginx.pid; error_log {tmp}/error.log warn;
events {{ worker_connections 256; }}
http {{
  access_log off; default_type application/octet-stream; sendfile on; keepalive_timeout 60;
  client_body_temp_path {tmp}/a; proxy_temp_path {tmp}/b; fastcgi_temp_path {tmp}/c; uwsgi_temp_path {tmp}/d;
  scgi_temp_path {tmp}/e;
  server {{ listen 127.0.0.1:{port}; root {folder}; }}
}}
"""


@contextmanager
def range_server(folder: Path, *, ranges: bool = True) -> Iterator[str]:
    """The address of a plain server of `folder` in this process, with ranges or without."""
    with running(partial(_Files, folder, ranges)) as address:
        yield address


@contextmanager
def nginx_server(folder: Path, tmp: Path) -> Iterator[str]:
    """The address of an nginx that serves `folder`; tmp: where its own files go."""
    assert NGINX is not None
    port = free_port()
    (tmp / "nginx.conf").write_text(CONF.format(tmp=tmp, port=port, folder=folder))
    with _process([NGINX, "-e", str(tmp / "error.log"), "-p", str(tmp), "-c", str(tmp / "nginx.conf")], port):
        yield f"http://127.0.0.1:{port}"


@contextmanager
def s3_server(folder: Path, bucket: str) -> Iterator[str]:
    """The address of an S3 service whose `bucket` holds the files of `folder`; keys are those of `KEYS`."""
    import boto3
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        client = boto3.client("s3", endpoint_url=f"http://{host}:{port}", aws_access_key_id="test",
                              aws_secret_access_key="test", region_name="us-east-1")
        client.create_bucket(Bucket=bucket)
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                client.put_object(Bucket=bucket, Key=path.relative_to(folder).as_posix(), Body=path.read_bytes())
        client.close()
        yield f"http://{host}:{port}"
    finally:
        server.stop()


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


@contextmanager
def _process(command: list[str], port: int) -> Iterator[None]:
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        end = monotonic() + PATIENCE
        while not _listens(port):
            if process.poll() is not None or monotonic() > end:
                raise RuntimeError(f"{command[0]} did not start")
            sleep(0.01)
        yield
    finally:
        process.terminate()
        process.communicate()


def _listens(port: int) -> bool:
    with socket.socket() as found:
        return found.connect_ex(("127.0.0.1", port)) == 0


class _Files(BaseHTTPRequestHandler):
    """Files of a folder, whole and by range. RFC 9110, section 14."""

    protocol_version = "HTTP/1.1"

    def __init__(self, folder: Path, ranges: bool, *arguments: object):
        self.folder, self.ranges = folder, ranges
        super().__init__(*arguments)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Answer with a file or a piece of it."""
        path = self.folder / unquote(urlsplit(self.path).path).lstrip("/")
        if not path.is_file():
            return self._answer(404, {}, b"none")
        found = path.stat()
        mark = hashlib.sha256(f"{found.st_mtime_ns} {found.st_size}".encode()).hexdigest()[:16]
        headers = {"ETag": f'"{mark}"'}
        wanted = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        if not wanted or not self.ranges:
            return self._answer(200, headers, path.read_bytes())
        start, last = int(wanted[1]), min(int(wanted[2] or found.st_size), found.st_size - 1)
        if start > last:
            return self._answer(416, {"Content-Range": f"bytes */{found.st_size}"}, b"")
        with path.open("rb") as stream:
            body = os.pread(stream.fileno(), last + 1 - start, start)
        return self._answer(206, {**headers, "Content-Range": f"bytes {start}-{last}/{found.st_size}"}, body)

    def _answer(self, status: int, headers: dict[str, str], body: bytes) -> None:
        self.send_response(status)
        for name, value in {**headers, "Content-Length": str(len(body))}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Keep quiet."""
