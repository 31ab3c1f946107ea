#!/usr/bin/env bash
# The radiosity solvers on a closed room, as one JSON object each: `lambent bench solvers` in the form of the other
# benchmarks.
source "$(dirname "$0")/common.sh"
$tool --json bench solvers "$@" 2>/dev/null | python3 -c '
import json, sys
bench = json.load(sys.stdin)
jacobi = next(s["applications"] for s in bench["solvers"] if s["solver"] == "jacobi")
for s in bench["solvers"]:
    print(json.dumps({"name": "radiosity_solver_" + s["solver"], "ours": s["applications"], "limit": jacobi,
                      "ratio": s["applications"] / jacobi, "unit": "applications",
                      "limit_is": "Jacobi, to a residual of %g" % bench["tolerance"], "receivers": bench["receivers"],
                      "seconds": s["seconds"], "steps": [[k["applications"], k["residual"]] for k in s["steps"]],
                      "aim": "< 1" if s["solver"] == "gmres" else ""}))'
