#!/bin/sh
# `make demo` and `make test` on every supported Python, each in a separate environment,
# and once with the oldest libraries that setup.py allows; then a table. Called by `make matrix`.
#
#     scripts/matrix.sh               all of them
#     scripts/matrix.sh 3.12 lowest   these
cd "$(dirname "$0")/.." || exit 1
logs=build/matrix
mkdir -p "$logs"

# Find the interpreter of a version on the PATH or in pyenv.
interpreter() {
    for found in "$(command -v "python$1")" "$HOME"/.pyenv/versions/"$1".*/bin/python; do
        if [ -x "$found" ] && "$found" -c '' 2>/dev/null; then
            echo "$found"
            return
        fi
    done
}

# Install the oldest libraries in an environment, so that make has nothing to install.
install_lowest() {
    [ -x "$2/bin/python" ] || "$1" -m venv "$2" || return
    python3 scripts/lower_bounds.py > "$logs/lowest.txt" || return
    python3 scripts/lower_bounds.py pinocchio > "$logs/lowest-pinocchio.txt" || return
    set -- "$2" "$2/bin/python -m pip --disable-pip-version-check --quiet"
    $2 install --upgrade pip &&
        $2 install --requirement "$logs/lowest.txt" &&
        $2 install --no-deps --requirement "$logs/lowest-pinocchio.txt" &&
        $2 install --no-deps --editable . &&
        touch "$1/.demo" "$1/.test"
}

[ $# -gt 0 ] || set -- 3.10 3.11 3.12 3.13 lowest
failed=0
table=
for name; do
    version=$name
    # the last Python with wheels of all of them
    [ "$name" != lowest ] || version=3.11
    python=$(interpreter "$version")
    if [ "$name" = lowest ] && [ -n "$python" ]; then
        install_lowest "$python" .venv-lowest > "$logs/lowest-install.log" 2>&1 || {
            echo "lowest: not installed: $logs/lowest-install.log"
            failed=1
            continue
        }
    fi
    for what in demo test; do
        log=$logs/$name-$what.log
        begun=$(date +%s)
        if [ -z "$python" ]; then
            result="no Python $version"
            failed=1
        elif make "$what" PYTHON="$python" VENV=".venv-$name" > "$log" 2>&1; then
            result=passed
        else
            result="failed: $log"
            failed=1
        fi
        line=$(printf '%-7s %-5s %5d s  %s' "$name" "$what" $(($(date +%s) - begun)) "$result")
        echo "$line"
        table="$table$line
"
    done
done
printf '\n%s' "$table" | tee "$logs/table.txt"
exit $failed
