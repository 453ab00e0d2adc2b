"""Objects of an EDS file as python-canopen's own import reads them, for one node; prints JSON.

usage: eds_objects.py FILE NODE
"""
import json
import sys

import canopen
from canopen.objectdictionary import ODVariable

dictionary = canopen.import_od(sys.argv[1], node_id=int(sys.argv[2]))
found = []
for entry in dictionary.values():
    for one in [entry] if isinstance(entry, ODVariable) else entry.values():
        found.append([one.index, one.subindex, one.name, one.data_type, one.access_type, one.default])
print(json.dumps(found))
