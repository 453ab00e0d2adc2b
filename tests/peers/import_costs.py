"""What `muprime import` of each file of a folder costs: import_costs.py FOLDER MUPRIME [ARGUMENT ...] prints, a line each as JSON, the name, the exit
status, the processor time in s and the largest memory in bytes.
"""
import json
import os
import sys

folder, program, *more = sys.argv[1:]
for name in sorted(os.listdir(folder)):
    if name.startswith("out"):
        continue
    pid = os.fork()
    if pid == 0:
        quiet = os.open(f"{folder}/out.{name}.txt", os.O_WRONLY | os.O_CREAT)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        os.execv(program, [program, "import", f"{folder}/{name}", "--yes", "-o", f"{folder}/out.{name}", *more])
    _, status, used = os.wait4(pid, 0)
    with open(f"{folder}/out.{name}.txt", encoding="utf-8", errors="replace") as said:
        words = said.read()
    print(json.dumps({"name": name, "bytes": os.path.getsize(f"{folder}/{name}"), "status": os.waitstatus_to_exitcode(status),
                      "seconds": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss * 1024, "said": words}))
