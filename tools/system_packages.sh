#!/usr/bin/env bash
# Sees to the programs and libraries that the operating system provides: a C compiler, CMake, Ninja, SUNDIALS and
# SuiteSparse with their headers, and Python's venv. Whatever is missing is installed by apt where this user may do
# so (as root or by sudo without a password); otherwise the line to run is printed and the script ends with status 1.
#
#   tools/system_packages.sh [--print] [--python PROGRAM] [--tests] [--realtime]
#
#   --print    only print the line that installs everything, whether missing or not
#   --python   the Python that the virtual environment is made from (default: python3)
#   --tests    also what the tests need: cmocka, cppcheck, a compiler and an emulator for Cortex-M, clang with libFuzzer,
#              user-mode Linux with can-utils and iproute2 for the tests on a CAN bus
#   --realtime also what make hil-realtime needs: the emulator of a PC
set -euo pipefail

print_only=no
python=python3
tests=no
realtime=no
while [ $# -gt 0 ]; do
    case "$1" in
        --print) print_only=yes ;;
        --python) python=${2:?"--python needs a program"}; shift ;;
        --tests) tests=yes ;;
        --realtime) realtime=yes ;;
        *) echo "$0: unknown argument '$1'" >&2; exit 2 ;;
    esac
    shift
done

always=(build-essential cmake ninja-build libsundials-dev libsuitesparse-dev python3-venv)
if [ "$tests" = yes ]; then
    always+=(libcmocka-dev cppcheck gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm clang libclang-rt-dev)
    always+=(user-mode-linux can-utils iproute2)
fi
if [ "$realtime" = yes ]; then
    always+=(qemu-system-x86)
fi
if [ "$print_only" = yes ]; then
    echo "sudo apt-get install --no-install-recommends ${always[*]}"
    exit 0
fi

missing=()

have_program() { command -v "$1" >/dev/null 2>&1; }

# True if the compiler finds the header. Its contents are not read, so that an include path for what the header
# itself includes is not needed. Debian keeps SuiteSparse's headers one folder down.
have_header() {
    local header
    have_program cc || return 1
    for header in "$1" "suitesparse/$1"; do
        if printf '#if !__has_include(<%s>)\n#error missing\n#endif\n' "$header" | cc -E -x c - >/dev/null 2>&1; then
            return 0
        fi
    done
    return 1
}

# True if the cross compiler has a C library to link with; without one it names the file and no path.
have_newlib() { [[ $(arm-none-eabi-gcc -print-file-name=libc.a 2>/dev/null) == */* ]]; }

# True if clang links a fuzz target: Debian keeps libFuzzer and the sanitizers in a package beside clang.
have_fuzzer() {
    printf '#include <stddef.h>\n#include <stdint.h>\nint LLVMFuzzerTestOneInput(const uint8_t *d, size_t n) { return !d && n; }' |
        clang -fsanitize=fuzzer,address,undefined -x c - -o /dev/null >/dev/null 2>&1
}

if ! have_program "$python"; then
    echo "gustform needs Python 3.11 or newer, and '$python' is not a program here." >&2
    echo "Install python3, or name another one: make PYTHON=python3.12 demo" >&2
    exit 1
fi
if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
    echo "gustform needs Python 3.11 or newer; $python is $("$python" -V 2>&1)." >&2
    echo "Install a newer one beside it and name it: make PYTHON=python3.12 demo" >&2
    exit 1
fi
if ! "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then
    # Debian keeps ensurepip in a package of its own, one for each Python version.
    version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    if [ -x /usr/bin/python3 ] && [ "$(/usr/bin/python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')" = "$version" ]; then
        missing+=(python3-venv)
    else
        missing+=("python$version-venv")
    fi
fi
have_program cc && have_header stdio.h || missing+=(build-essential)
have_program cmake || missing+=(cmake)
have_program ninja || missing+=(ninja-build)
have_header ida/ida.h && have_header sunlinsol/sunlinsol_klu.h || missing+=(libsundials-dev)
have_header klu.h || missing+=(libsuitesparse-dev)
if [ "$tests" = yes ]; then
    have_header cmocka.h || missing+=(libcmocka-dev)
    have_program cppcheck || missing+=(cppcheck)
    # The exported controllers on emulated Cortex-M boards.
    have_program arm-none-eabi-gcc || missing+=(gcc-arm-none-eabi)
    have_newlib || missing+=(libnewlib-arm-none-eabi)
    have_program qemu-system-arm || missing+=(qemu-system-arm)
    have_program clang || missing+=(clang)
    have_fuzzer || missing+=(libclang-rt-dev)
    have_program linux.uml || missing+=(user-mode-linux)
    have_program cangen || missing+=(can-utils)
    PATH=$PATH:/usr/sbin:/sbin have_program tc || missing+=(iproute2)
fi
if [ "$realtime" = yes ]; then
    have_program qemu-system-x86_64 || missing+=(qemu-system-x86)
fi

if [ ${#missing[@]} -eq 0 ]; then
    exit 0
fi

install=(apt-get install --yes --no-install-recommends "${missing[@]}")
if ! have_program apt-get; then
    echo "These are missing, by the names of their Debian packages: ${missing[*]}" >&2
    echo "Install them with this system's package manager, then run make again." >&2
    exit 1
fi
if [ "$(id -u)" -eq 0 ]; then
    as_root=(env DEBIAN_FRONTEND=noninteractive)
elif have_program sudo && sudo -n true >/dev/null 2>&1; then
    as_root=(sudo -n env DEBIAN_FRONTEND=noninteractive)
else
    echo "System packages are missing, and installing them needs root. Run this line, then make again:" >&2
    echo >&2
    echo "    sudo apt-get update && sudo apt-get install --no-install-recommends ${missing[*]}" >&2
    echo >&2
    exit 1
fi

log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "   installing ${missing[*]} by apt (a few minutes the first time)"
# A stale package list may still do, so only the installation decides.
"${as_root[@]}" apt-get update >"$log" 2>&1 || true
if ! "${as_root[@]}" "${install[@]}" >>"$log" 2>&1; then
    tail -n 25 "$log" >&2
    echo >&2
    echo "apt-get failed. When its complaint above is settled, run make again; the line was:" >&2
    echo "    ${install[*]}" >&2
    exit 1
fi
