"""A release on Hugging Face's hub: large files are sent one by one, and one commit makes all of them appear.

Files that the hub knows already, by hash, are not sent again, also those of a push that was cut short.
https://huggingface.co/docs/huggingface_hub/guides/upload
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import TYPE_CHECKING, Any

from dataset_builder.digest import read_regular, sha256_file
from dataset_builder.errors import Problem, ShardError, UserError
from dataset_builder.extras import missing_named
from dataset_builder.remote.address import require_sound, said
from dataset_builder.shards.folder import MANIFEST, MOST_BYTES
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.transfer.fetching import TransferProgress
from dataset_builder.transfer.origin import Origin
from dataset_builder.transfer.outgoing import Pushed, SentFile, left_over_there, other_content, require_room

if TYPE_CHECKING:
    from huggingface_hub import HfApi


def push_to_hub(origin: Origin, files: Sequence[SentFile], address: str, *, replace: bool, prune: bool,
                told: Callable[[TransferProgress], None], api: "HfApi | None" = None) -> Pushed:
    """Send a release to `hf://datasets/USER/NAME[@BRANCH]`; see `push.push`. A repository that is not there is made,
    for its owner alone to see. Nothing of the release appears before its one commit, and then all of it does."""
    require_sound(address, "hf")
    with missing_named():
        import huggingface_hub as hub

    name, _, branch = address.partition("://")[2].rstrip("/").removeprefix("datasets/").partition("@")
    title, begun = f"hf://datasets/{name}", monotonic()
    where: dict[str, Any] = {"repo_id": name, "repo_type": "dataset", "revision": branch or "main"}
    with _errors(title):
        api = api or hub.HfApi()
        api.create_repo(repo_id=name, repo_type="dataset", private=True, exist_ok=True)
        if branch:
            api.create_branch(repo_id=name, repo_type="dataset", branch=branch, exist_ok=True)
        head = api.repo_info(**where).sha
        there = _there(api, where)
        require_room(title, _manifest_there(api, where, there, title), origin, replace=replace)
        new = [file for file in files if not _same(there.get(file.name), file)]
        for file in new:
            if "/" in file.name and file.name in there:
                raise other_content(title, file.name)
        left = left_over_there(there, files)
        added = [hub.CommitOperationAdd(path_in_repo=file.name, path_or_fileobj=str(file.path)) for file in new]
        total, done = sum(file.size for file in new), 0
        for file, operation in zip(new, added, strict=True):
            # What the hub takes into the commit itself is passed over
            api.preupload_lfs_files(additions=[operation], **where)
            done += file.size
            told(TransferProgress(done=done, total=total, moved=done, seconds=monotonic() - begun))
        gone = [hub.CommitOperationDelete(path_in_repo=one) for one in left] if prune else []
        if added or gone:
            api.create_commit(operations=[*added, *gone], parent_commit=head, **where,
                              commit_message=f"{origin.manifest.name} {origin.manifest.version}")
        there = _there(api, where)
    if unseen := [file.name for file in files if not _same(there.get(file.name), file)]:
        raise ShardError([Problem(where=title, path=unseen[0], rule="expected it as it was sent, the hub lists another",
                                  hint="push again")])
    return Pushed(sha256=origin.sha256, files=len(new), sent=total, left=() if prune else left)


def _there(api: "HfApi", where: Mapping[str, Any]) -> dict[str, Any]:
    """What the hub lists, files alone, by name."""
    return {item.path: item for item in api.list_repo_tree(recursive=True, **where) if hasattr(item, "size")}


def _same(item: Any, file: SentFile) -> bool:
    """Whether a file that the hub lists has the content of one here: by the hash that it keeps of it."""
    if item is None or item.size != file.size:
        return False
    if item.lfs is not None:
        return bool(item.lfs.sha256 == sha256_file(file.path))
    return bool(item.blob_id == git_blob(file.path))


def git_blob(path: Path) -> str:
    """The name that git gives a file's content. https://git-scm.com/book/en/v2/Git-Internals-Git-Objects"""
    data = path.read_bytes()
    return hashlib.sha1(f"blob {len(data)}\0".encode() + data, usedforsecurity=False).hexdigest()


def _manifest_there(api: "HfApi", where: Mapping[str, Any], there: Mapping[str, Any], title: str) -> Manifest | None:
    if MANIFEST not in there:
        return None
    with TemporaryDirectory() as folder:
        path = api.hf_hub_download(filename=MANIFEST, local_dir=folder, **where)
        return from_json(Manifest, read_regular(Path(path), most=MOST_BYTES), where=f"{title}: {MANIFEST}")


@contextmanager
def _errors(title: str) -> Iterator[None]:
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        # Of several libraries, without a common class
        raise UserError([Problem(where=title, path="", rule=said(error), hint="see to your token (`hf auth login`) and "
                                 "the name; what was sent is kept")]) from error
