#!/bin/bash
# Prints the figures of README.md's claims and of tests/bench/README.md, by running the program:
#     tests/bench/measure.sh build/ci/bin/jacket
# Times are of one process on whatever machine this is; run it twice and compare ratios, not milliseconds.
set -euo pipefail
jacket=${1:?usage: measure.sh PATH/TO/jacket}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# run NAME SCENE [options]: keeps DIR/NAME.
run() {
    local name=$1
    shift
    "$jacket" run "$@" --quiet --out "$out/$name" || true  # 3: not converged, which the table then says
}
# value NAME KEY: a number or word of result.json, which has one key a line.
value() { sed -n "s/^ *\"$2\": *\([^,]*\),\{0,1\}$/\1/p" "$out/$1/result.json" | head -n 1; }
# part NAME KEY PART: a number of an object of result.json.
part() { sed -n "/\"$2\"/,/}/p" "$out/$1/result.json" | sed -n "s/.*\"$3\": *\([0-9.e-]*\).*/\1/p"; }
per_second() { awk -v f="$(value "$1" frames)" -v w="$(value "$1" wall_s)" 'BEGIN { printf "%.0f", f / w }'; }
ball_height() {
    tr -d ' \n' <"$out/$1/result.json" | sed -n 's/.*"name":"ball","position":\[[^,]*,\([^,]*\),.*/\1/p'
}

echo "machine: $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) processors"
echo
echo "trampoline: 2 kg ball on a 2 x 2 m sheet, 60 Hz, 3 s"
printf '%10s %14s %12s %12s %10s %10s\n' "vertices" "penetration/m" "ball y/m" "stretch" "ms/step" "converged"
for n in 11 31 71 101; do
    run "t$n" trampoline --set "shells.0.mesh.grid.cells=[$((n - 1)),$((n - 1))]"
    printf '%10s %14s %12.4f %12s %10s %10s\n' "$n x $n" "$(value "t$n" max_penetration)" "$(ball_height "t$n")" \
        "$(value "t$n" peak_stretch)" "$(part "t$n" ms_per_step median)" "$(value "t$n" converged)"
done

echo
echo "the thesis's scenes, frames per second (thesis: 8-10, 26-28, 62-64)"
run finite_difference cloth_sphere
run quadratic cloth_sphere --set shells.0.bending=quadratic
run bowl bowl
printf '%40s %6s\n' "cloth_sphere, finite differences" "$(per_second finite_difference)" \
    "cloth_sphere, quadratic" "$(per_second quadratic)" "bowl, cubic shell" "$(per_second bowl)"

echo
echo "drape, 71 x 71, over eight spheres whose radii differ by 0.05 mm: what the tolerance of the linear solve changes"
printf '%10s %12s %14s %14s %14s %14s\n' "tolerance" "iterations" "end stretch" "largest of 8" "peak stretch" "largest of 8"
for tolerance in 1e-2 1e-3 1e-4; do
    for i in 0 1 2 3 4 5 6 7; do
        run "d$i" drape --set 'shells.0.mesh.grid.cells=[70,70]' --set "shells.0.tolerance=$tolerance" \
            --set "bodies.0.shape.sphere=$(awk -v i="$i" 'BEGIN { print 0.5 + 5e-5 * i }')"
        echo "$(part "d$i" pcg_iterations mean) $(value "d$i" max_stretch) $(value "d$i" peak_stretch)"
    done | awk -v tolerance="$tolerance" '
        { it += $1; end += $2; peak += $3; if ($2 > most) most = $2; if ($3 > highest) highest = $3 }
        END { printf "%10s %12.1f %14.4f %14.4f %14.4f %14.4f\n", tolerance, it / NR, end / NR, most, peak / NR, highest }'
done

echo
echo "free sheet and spinning ball, no gravity: relative change of linear momentum"
run free free_sheet_ball
echo "    $(value free momentum_error)"
