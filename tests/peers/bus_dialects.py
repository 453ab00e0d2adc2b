"""DBC files and CANopen data sheets in many dialects: bus_dialects.py FOLDER writes them, and prints as JSON lines what cantools and
python-canopen make of each.
"""
import json
import random
import sys

import canopen
import cantools

folder = sys.argv[1]
random.seed(39)


def signal(name, start, size, order, sign, factor, offset, mux=""):
    return f' SG_ {name} {mux}: {start}|{size}@{order}{sign} ({factor},{offset}) [0|0] "N" Vector__XXX\n'


def body(k):
    """A message with signals of both orders at random places, without overlap in its bytes."""
    name = random.choice(["Force", "meas_1", "Force_2017_", "A" * 28]) + str(k)
    raw = random.choice([random.randrange(1, 0x800), random.randrange(1 << 29) | 1 << 31])
    lines, at, floats = "", 0, ""
    for n in range(random.randint(1, 4)):
        size = random.choice([8, 12, 16, 16, 24, 32])
        if at + (size + 7) // 8 > 8:
            break
        order, sign = random.choice([0, 1]), random.choice("+-")
        start = 8 * at + 7 if order == 0 else 8 * at
        factor, offset = random.choice([1, 0.01, 6.1e-05, 0.5, -2, 1]), random.choice([0, -40, 0.25])
        if size == 32 and random.random() < 0.5:
            floats += f"SIG_VALTYPE_ {raw} S{n} : 1;\n"
        lines += signal(f"S{n}", start, size, order, sign, factor, offset)
        at += (size + 7) // 8
    return name, raw, f"BO_ {raw} {name}: 8 Rig\n{lines}\n", floats


HEADS = [
    'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: Rig\n\n',
    'VERSION "1.0"\r\n\r\nNS_ :\r\n\tCM_\r\n\tBA_\r\n\r\nBS_: \r\n\r\nBU_: Rig Vector__XXX\r\n\r\n',
    'VERSION ""\nNS_ :\nBS_:\nBU_:\n',
]
TAILS = [
    "",
    'CM_ "a remark; with a semicolon";\n',
    'CM_ SG_ {raw} S0 "several\nBO_ 5 lines: 8 X\n SG_ no : 0|8@1+ (1,0) [0|0] \\"\\" X\n";\n',
    'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\nBA_DEF_DEF_ "GenMsgCycleTime" 100;\nBA_ "GenMsgCycleTime" BO_ {raw} 10;\n',
    'VAL_ {raw} S0 0 "off" 1 "on" ;\n',
    'BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;\nBA_ "SystemMessageLongSymbol" BO_ {raw} "TheLongNameOfThisMessageIsLonger";\n',
]
STORE = 'BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n SG_ Spare : 0|8@1+ (1,0) [0|0] "" Vector__XXX\n\n'
for k in range(96):
    name, raw, lines, floats = body(k)
    other, raw2, lines2, floats2 = body(k + 1000)
    text = random.choice(HEADS) + (STORE if k % 7 == 3 else "") + lines + (lines2 if raw2 != raw else "")
    text += random.choice(TAILS).format(raw=raw) + floats + (floats2 if raw2 != raw else "")
    text = text.replace('"N"', '"°C"', 1) if k % 5 == 2 else text
    encoding = ["cp1252", "utf-8", "utf-8-sig"][k % 3] if k % 5 == 2 else "cp1252"
    path = f"{folder}/{k}.dbc"
    with open(path, "w", encoding=encoding, newline="") as out:
        out.write(text)
    database = cantools.database.load_string(text, "dbc")
    for message in database.messages:
        for _ in range(4):
            frame = random.randbytes(message.length)
            values = message.decode(frame, decode_choices=False)
            finite = {n: v for n, v in values.items() if isinstance(v, int) or v == v and abs(v) < 1e300}
            print(json.dumps({"file": path, "message": message.name, "id": message.frame_id, "extended": message.is_extended_frame,
                              "hex": frame.hex(), "values": finite}))

NODE = 5
for k in range(24):
    cob = ["$NODEID+0x180", "0x180+$NODEID", "$nodeid + 0x40000180", "0x185", "$NODEID+384"][k % 5]
    off = k % 8 == 7
    cob = "$NODEID+0x80000180" if off else cob
    mapped = ["0x60410010", "0x60640020"] if k % 3 else ["0x60640020", "0x606C0020"]
    given = ["0x606C0020" if k % 4 == 1 else None, None]
    sheet = "; a sheet\n[FileInfo]\nFileName=a.eds\nDescription=Müller\n\n[DeviceInfo]\nVendorName=Müller\nVendorNumber=001\n\n"
    sheet += "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n\n[1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\n"
    sheet += "AccessType=ro\nDefaultValue=0x192\nPDOMapping=0\n\n"
    for index, kind in [("6041", 6), ("6064", 4), ("606C", 4)]:
        sheet += f"[{index}]\nParameterName=Object {index}\nObjectType=0x7\nDataType={kind}\nAccessType=ro\nPDOMapping=1\n\n"
    sheet += "[1800]\nParameterName=TPDO 1\nObjectType=0x9\nSubNumber=2\n\n"
    sheet += f"[1800sub0]\nParameterName=n\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nDefaultValue=1\nPDOMapping=0\n\n"
    sheet += f"[1800sub1]\nParameterName=COB\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue={cob}\nPDOMapping=0\n\n"
    sheet += "[1A00]\nParameterName=Map 1\nObjectType=0x9\nSubNumber=3\n\n"
    sheet += "[1A00sub0]\nParameterName=n\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nDefaultValue=2\nPDOMapping=0\n\n"
    for n, (entry, value) in enumerate(zip(mapped, given), 1):
        remark = " ; a remark" if k % 6 == 2 else ""
        sheet += f"[1A00sub{n}]\nParameterName=m{n}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue={entry}{remark}\n"
        sheet += f"ParameterValue={value}\n" if value else ""
        sheet += "PDOMapping=0\n\n"
    # What python-canopen cannot read of these spellings it is given in another.
    plain = sheet.replace("=001", "=1").replace("$nodeid + ", "$NODEID+").encode("ascii", "replace")
    if k % 4 == 2:
        sheet = sheet.lower().replace("parametername", "ParameterName")
    if k % 2:
        sheet = sheet.replace("\n", "\r\n")
    path = f"{folder}/{k}.eds"
    encoding = ["utf-8", "cp1252", "utf-8-sig"][k % 3]
    with open(path, "w", encoding=encoding, newline="") as out:
        out.write(sheet)
    with open(f"{folder}/plain.eds", "wb") as out:
        out.write(plain)
    objects = canopen.import_od(f"{folder}/plain.eds", node_id=NODE)
    value = lambda o: o.value if o.value is not None else o.default
    entries = [value(objects[0x1A00][n]) for n in range(1, value(objects[0x1A00][0]) + 1)]
    print(json.dumps({"file": path, "cob": value(objects[0x1800][1]), "entries": entries}))
