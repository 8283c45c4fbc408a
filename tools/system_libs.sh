#!/bin/sh
# Make sure of libLLVM (Dr.Jit's CPU backend), and of libusb-1.0 and the display libraries that Open3D is linked with,
# though it never opens a window here; no wheel carries them.
# Installs them with apt-get where that is allowed, otherwise prints the line to type and exits with 1.
# LIBRARY_PATHS replaces where libraries are looked for, APT_GET the package tool: both are there for tests.
set -eu

llvm_versions="19 20 18 21 17"  # 14 is refused by Dr.Jit 1.5; 15 and 16 abort the process

known_libraries() {
    if [ -n "${LIBRARY_PATHS+set}" ]; then
        # shellcheck disable=SC2086 -- a list
        for folder in $LIBRARY_PATHS; do ls -d "$folder"/* 2>/dev/null || true; done
        return
    fi
    PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | sed -n 's/.* => //p'
    ls -d /usr/lib/llvm-*/lib/libLLVM* /usr/lib64/libLLVM* /usr/lib64/libusb-1.0* \
        /opt/homebrew/opt/llvm*/lib/libLLVM* /opt/homebrew/lib/libusb-1.0* 2>/dev/null || true
}

# Prints the names of the libraries that are missing: llvm, usb, display
missing() {
    libraries=$(known_libraries)
    good=
    [ -n "${DRJIT_LIBLLVM_PATH:-}" ] && [ -e "$DRJIT_LIBLLVM_PATH" ] && good=yes
    for version in $llvm_versions; do
        if echo "$libraries" | grep -Eq "(libLLVM[-.](so\.)?$version([.]|\$)|llvm[-@]$version/lib/libLLVM)"; then good=yes; fi
    done
    [ -n "$good" ] || echo llvm
    echo "$libraries" | grep -Eq 'libusb-1\.0\.(so|0?\.?dylib)' || echo usb
    # Every desktop has these, small container images do not
    [ "$(uname -s)" = Linux ] || return 0
    for name in libGL.so.1 libEGL.so.1 libX11.so.6 libidn2.so.0; do
        if ! echo "$libraries" | grep -q "/$name\$"; then
            echo display
            return
        fi
    done
}

apt_llvm() {
    for version in $llvm_versions; do
        if apt-cache policy "libllvm$version" 2>/dev/null | grep -q 'Candidate: [^(]'; then
            echo "libllvm$version"
            return
        fi
    done
    echo libllvm19
}

packages() {
    for name in $lacking; do
        case $1:$name in
            apt:llvm) apt_llvm ;;
            apt:usb) echo libusb-1.0-0 ;;
            apt:display) echo libgl1 libegl1 libx11-6 libidn2-0 ;;
            dnf:llvm) echo llvm-libs ;;
            dnf:usb) echo libusb1 ;;
            dnf:display) echo libglvnd-glx libglvnd-egl libX11 libidn2 ;;
            pacman:llvm) echo llvm-libs ;;
            pacman:usb) echo libusb ;;
            pacman:display) echo libglvnd libx11 libidn2 ;;
            brew:llvm) echo llvm@19 ;;
            brew:usb) echo libusb ;;
        esac
    done | tr '\n' ' ' | sed 's/ $//'
}

say_line() {
    {
        echo "system: missing: $(echo "$lacking" | tr '\n' ' ')(libLLVM 17 or newer for Dr.Jit, libusb-1.0 and display libraries for Open3D); type this line, then try again:"
        if command -v apt-get >/dev/null 2>&1; then
            echo "    sudo apt-get update && sudo apt-get install -y $(packages apt)"
        elif command -v dnf >/dev/null 2>&1; then
            echo "    sudo dnf install -y $(packages dnf)"
        elif command -v pacman >/dev/null 2>&1; then
            echo "    sudo pacman -S --needed $(packages pacman)"
        elif command -v brew >/dev/null 2>&1; then
            echo "    brew install $(packages brew)"
        else
            echo "    install libLLVM 19, libusb-1.0, libGL, libEGL, libX11 and libidn2 with your system's package manager"
        fi
    } >&2
    exit 1
}

lacking=$(missing)
[ -n "$lacking" ] || exit 0

apt_get=${APT_GET:-apt-get}
command -v "$apt_get" >/dev/null 2>&1 || say_line
as_root=
if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null || say_line
    as_root="sudo -n"
fi

# A machine that never updated its lists knows no packages, and old lists name packages that are gone
echo "system: installing what is missing: $(echo "$lacking" | tr '\n' ' ')"
$as_root "$apt_get" update -qq || say_line
# shellcheck disable=SC2046,SC2086 -- lists of words
$as_root env DEBIAN_FRONTEND=noninteractive "$apt_get" install -y -qq --no-install-recommends $(packages apt) >/dev/null || say_line
lacking=$(missing)
[ -z "$lacking" ] || say_line
