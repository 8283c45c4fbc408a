"""Where a dataset is, as people write it: a path, or an address."""

import re
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit, urlunsplit

from dataset_builder.errors import Problem, UserError

DRIVERS = {"http": ("fsspec", "aiohttp"), "https": ("fsspec", "aiohttp"), "s3": ("fsspec", "s3fs"),
           "gs": ("fsspec", "gcsfs"), "hf": ("fsspec", "huggingface_hub")}
"""Libraries that read what lies at addresses with each scheme."""
HUB = re.compile(r"datasets/[\w.-]+/[\w.-]+(@[\w./-]+)?")
SAID = 200
"""Characters of a library's message."""
SAFE = "/%:@!$&'()*+,;=~"
"""What may stay as it is in the path of an address."""


def is_address(text: Path | str) -> bool:
    """Whether something is an address, and no path."""
    return isinstance(text, str) and "://" in text


def shown(address: str) -> str:
    """An address without passwords, keys and queries, for messages.

    >>> shown("https://me:secret@example.org/a b?key=1#part")
    'https://example.org/a b'
    """
    scheme, netloc, path, _, _ = urlsplit(address)
    return f"{scheme}://{netloc.rpartition('@')[2]}{path}".rstrip("/") if scheme != "hf" else address.rstrip("/")


def title_of(folder: Path | str) -> str:
    """What messages call a folder or an address."""
    return shown(folder) if isinstance(folder, str) and is_address(folder) else str(folder)


def scrubbed(text: str) -> str:
    """What a library says, without what is secret in the addresses in it."""
    return re.sub(r"\w+://[^\s'\")]+", lambda match: shown(match[0]), text)


def said(error: BaseException) -> str:
    """The kind of an error of some library and the beginning of its words, without what is secret in them.

    >>> said(ValueError("no bucket at s3://me:secret@x"))
    'ValueError: no bucket at s3://x'
    """
    return f"{type(error).__name__}: {scrubbed(str(error))[:SAID]}"


def file_url(address: str, name: str) -> str:
    """The address of a file at an http address; a query stays, which may be a key.

    >>> file_url("https://example.org/a b/?key=1", "shards/x.tar")
    'https://example.org/a%20b/shards/x.tar?key=1'
    """
    scheme, netloc, path, query, _ = urlsplit(address)
    return urlunsplit((scheme, netloc, f"{quote(path.rstrip('/'), safe=SAFE)}/{quote(name)}", query, ""))


def local_path(address: str) -> Path:
    """The path that an address with `file` stands for. Raises UserError where it has a host."""
    parts = urlsplit(address)
    if parts.netloc not in ("", "localhost") or not parts.path:
        raise refused(address, "expected file:///PATH, without a host", "write the path alone")
    return Path(unquote(parts.path))


def require_sound(address: str, scheme: str) -> None:
    """Raise UserError where an address has no host, or is not in the form that its scheme has."""
    try:
        parts = urlsplit(address)
        sound = bool(parts.netloc and (parts.hostname or scheme == "hf")) and (parts.port or 1) > 0
    except ValueError:
        sound = False
    if not sound or re.search(r"[\x00-\x1f\x7f]", address):
        raise refused(address, f"expected {scheme}://HOST/PATH")
    if scheme == "hf" and not HUB.fullmatch(address.partition("://")[2].rstrip("/")):
        raise refused(address, "expected hf://datasets/USER/NAME or hf://datasets/USER/NAME@REVISION")


def refused(address: str, rule: str, hint: str = "") -> UserError:
    """What is said of an address that cannot be used."""
    try:
        where = shown(address)
    except ValueError:
        where = "address"
    return UserError([Problem(where=where, path="", rule=rule, hint=hint)])
