"""Random frames of every message of a DBC file, decoded and encoded again by cantools, as JSON lines.

usage: dbc_values.py FILE
"""
import json
import random
import sys

import cantools

random.seed(20)
database = cantools.database.load_file(sys.argv[1])
for message in database.messages:
    for _ in range(400):
        frame = random.randbytes(message.length)
        values = message.decode(frame, decode_choices=False)
        packed = message.encode(values, strict=False)
        print(json.dumps({"message": message.name, "hex": frame.hex(), "values": values, "packed": packed.hex()}))
