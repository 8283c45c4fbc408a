"""Put the libraries of others that pages carry into `report/front/vendor`, from the pinned packages of `tools/front`.

Needs Node and npm, which nobody else does: what it writes is committed. `versions.json` says what each file is, with
its licence and SHA-256; a test holds the files to it. Two runs write equal bytes.
"""

import json
import shutil
import subprocess
from hashlib import sha256
from pathlib import Path
from typing import Any

FRONT = Path(__file__).parent / "front"
VENDOR = Path(__file__).parent.parent / "dataset_builder" / "report" / "front" / "vendor"
BUNDLES = {"three": "three.js"}
"""Packages that come as modules only, and the file that `FRONT/NAME.entry.js` becomes: one script with a global."""
COPIES = {"vue": ("dist/vue.global.prod.js", "vue.js")}
"""Packages that bring such a script, and what it becomes."""


def main() -> None:
    """Install what the lock file pins, and write the folder anew."""
    subprocess.run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=FRONT, check=True)
    shutil.rmtree(VENDOR, ignore_errors=True)
    VENDOR.mkdir()
    for name, file in BUNDLES.items():
        subprocess.run(["node_modules/.bin/esbuild", f"{name}.entry.js", "--bundle", "--minify", "--format=iife",
                        f"--global-name={name.upper()}", "--target=es2022", "--legal-comments=inline",
                        "--log-level=warning", f"--outfile={VENDOR / file}"], cwd=FRONT, check=True)
    for name, (source, file) in COPIES.items():
        shutil.copyfile(FRONT / "node_modules" / name / source, VENDOR / file)
    files = BUNDLES | {name: file for name, (_, file) in COPIES.items()}
    about = [_about(name, file) for name, file in sorted(files.items())]
    (VENDOR / "versions.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def _about(name: str, file: str) -> dict[str, Any]:
    """What `versions.json` says of a package; its licence is copied."""
    folder = FRONT / "node_modules" / name
    package = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    licence = f"{name}.LICENSE"
    shutil.copyfile(folder / "LICENSE", VENDOR / licence)
    return {"name": name, "version": package["version"], "licence": package["license"], "licence_file": licence,
            "file": file, "sha256": sha256((VENDOR / file).read_bytes()).hexdigest()}


if __name__ == "__main__":
    main()
