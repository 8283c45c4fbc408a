#!/bin/sh
# Make the virtual environment named by $1 and install this project with locked packages and the extras $2 into it.
set -eu
venv=$1 extras=$2
cd "$(dirname "$0")/.."

new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

# Find a Python
python=
for name in python3.13 python3.12 python3.11 python3; do
    if command -v "$name" >/dev/null 2>&1 && new_enough "$name"; then
        python=$name
        break
    fi
done
if [ -z "$python" ]; then
    echo "install: expected Python >= 3.11 on the PATH, found $(python3 --version 2>/dev/null || echo none)" >&2
    exit 1
fi
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    echo "install: $python cannot make virtual environments; on Debian and Ubuntu type:" >&2
    echo "    sudo apt-get install -y python$version-venv" >&2
    exit 1
fi

# Keep an environment that works, replace one that does not
if [ ! -x "$venv/bin/python" ] || ! new_enough "$venv/bin/python" || ! "$venv/bin/python" -m pip --version >/dev/null 2>&1
then
    "$python" -m venv --clear "$venv"
fi
echo "install: packages into $venv (the first time takes a minute or two)"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[$extras]"
