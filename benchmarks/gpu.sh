#!/usr/bin/env bash
# Measure MUTE on an NVIDIA GPU in ten minutes and write one JSON file.
#
#   benchmarks/gpu.sh [--out FILE] [--wheels DIR] [--venv DIR | --python PYTHON]
#                     [--peers-from DIR] [--dry-run-on-cpu]
#
# The machine needs the driver, Python 3.11 to 3.13 with venv, and this checkout. The packages come
# from the index that pip knows, or from --wheels alone, which needs no network; they are installed
# into --venv (.gpu-venv unless given) and stay there for the next time. --python names an
# interpreter that has MUTE with its extra `gpu` already. mjlab is timed beside if --peers-from names
# a folder of `python -m benchmarks.make_peers` with it, made for a GPU.
#
# The ten minutes hold the installation as well; what it takes is taken from the parts at the end.
# This script has not been run on a GPU yet: all of it but CUDA itself has, by --dry-run-on-cpu.
set -euo pipefail

fail() {
    printf 'error: %s\n' "$1" >&2
    exit 2
}

started=$SECONDS
total=600
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
venv="$here/.gpu-venv"
out="$PWD/gpu.json"
python=""
wheels=""
arguments=()
while [ $# -gt 0 ]; do
    case "$1" in
        --dry-run-on-cpu)
            arguments+=("$1")
            shift
            continue
            ;;
        --out | --wheels | --venv | --python | --peers-from)
            [ $# -ge 2 ] || fail "$1 needs a value"
            ;;
        *) fail "unknown option $1; there are --out, --wheels, --venv, --python, --peers-from and --dry-run-on-cpu" ;;
    esac
    case "$1" in
        --out) out="$(realpath -m "$2")" ;;
        --wheels) wheels="$(realpath -m "$2")" ;;
        --venv) venv="$(realpath -m "$2")" ;;
        # Links stay: an interpreter finds its packages by the path it is called by.
        --python) python="$(realpath -ms "$2")" ;;
        --peers-from) arguments+=("$1" "$(realpath -m "$2")") ;;
    esac
    shift 2
done
[ -d "$(dirname "$out")" ] || fail "--out: there is no folder $(dirname "$out")"
[ ! -d "$out" ] || fail "--out: $out is a folder"
if [ -n "$python" ] && { [ ! -f "$python" ] || [ ! -x "$python" ]; }; then
    fail "--python: $python is no program that can be run"
fi
rm -f "$out" || fail "--out: $out cannot be replaced" # what is there is of another time

# One line in the file, where nothing else can be.
give_up() {
    printf '{"error": "%s"}\n' "$1" >"$out"
    fail "$1"
}

# Print the first Python that MUTE and its packages run with.
find_python() {
    local name
    for name in python3.11 python3.12 python3.13 python3; do
        if "$name" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
            2>/dev/null; then
            command -v "$name"
            return
        fi
    done
}

# Make the virtual environment; without pip it is of no use and would be taken for one next time.
make_venv() {
    local existed=no
    [ ! -e "$venv" ] || existed=yes
    if ! "$1" -m venv "$venv" >/dev/null 2>&1 || ! "$python" -m pip --version >/dev/null 2>&1; then
        [ $existed = yes ] || rm -rf "$venv"
        give_up "no virtual environment with pip can be made by $1; Debian has python3-venv for it"
    fi
}

if [ -z "$python" ]; then
    python="$venv/bin/python"
    if ! "$python" -c 'import mute.learning.runner, mujoco_warp' 2>/dev/null; then
        base="$(find_python)"
        [ -n "$base" ] || give_up "Python 3.11, 3.12 or 3.13 is not there"
        [ -x "$python" ] || make_venv "$base"
        options=(--quiet)
        [ -z "$wheels" ] || options+=(--no-index --find-links "$wheels")
        printf 'installing into %s\n' "$venv"
        timeout 300 "$python" -m pip install "${options[@]}" "${here}[gpu]" ||
            give_up "the packages cannot be installed, or not in 300 s"
    fi
fi

cd "$here"
left=$((total - (SECONDS - started)))
exec "$python" -m benchmarks.gpu --out "$out" --seconds "$left" ${arguments[@]+"${arguments[@]}"}
