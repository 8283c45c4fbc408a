"""What is said of addresses that cannot be used: never a password, wherever it stands."""

from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.remote.open_place import place_of


@pytest.mark.parametrize(("address", "reason"), [
    ("ftp://example.org/a", "begins with file, http, https, s3, gs, hf, got ftp"), ("http:///a", "http://HOST/PATH"),
    ("https://me:secret@:99999/a", "HOST"), ("http://a:b:c/", "HOST"), ("hf://models/a/b", "hf://datasets/USER/NAME"),
    ("file://host/a", "without a host"), ("http://a/\r\nHost: b", "HOST"), ("file:///a#b", "%23"),
    ("https://me:sec/secret@example.org/a", "example.org/a: .*%2F"),
    ("https://me:secret#x@example.org/a", "example.org/a:"),
    ("https://me:secret?x@example.org/a", "example.org/a:"), ("https://example.org/a#b", "a name with # has %23"),
    ("https://[me:secret@example.org/a", "HOST"), ("s3://key:secret@bucket/a", "s3://bucket/a: .*in the environment"),
    ("hf://me:secret@datasets/a/b", "USER/NAME"), ("hf://datasets/a/b@main?token=secret", "hf://datasets/a/b@main: ")])
def test_addresses_that_are_none_are_refused(address: str, reason: str) -> None:
    with pytest.raises(UserError, match=reason) as caught:
        place_of(address)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("place", ["http://me:{}@127.0.0.1/a", "https://[me:{}@127.0.0.1/a"])
@pytest.mark.parametrize("words", [("verify", "{}"), ("pull", "nowhere", "{}"), ("push", "{}", "nowhere"),
                                   ("build", "spec.yaml", "--out", "{}"), ("merge", "spec.yaml", "{}"),
                                   ("plan", "spec.yaml", "--against", "{}"), ("export", "a", "{}", "--format", "mds")])
def test_where_only_a_path_will_do_an_address_is_named_and_not_made_a_folder(
        words: tuple[str, ...], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main([word.format(place.format("sec/secret")) for word in words])
    said = capsys.readouterr().err
    assert "on this machine, got the address" in said and "://127.0.0.1/a" in said and "secret" not in said
    assert not list(tmp_path.iterdir())
