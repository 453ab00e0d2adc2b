"""The objects of a CiA 402 drive in profile-velocity mode, for python-canopen, from the standard's tables."""
from canopen.objectdictionary import ObjectDictionary, ODRecord, ODVariable, datatypes


def dictionary():
    objects = ObjectDictionary()

    def variable(index, sub, name, kind, access, value):
        entry = ODVariable(name, index, sub)
        entry.data_type, entry.access_type, entry.default, entry.value = kind, access, value, value
        return entry

    u8, u16, u32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
    for entry in (
        variable(0x1000, 0, "Device type", u32, "ro", 0x00020192),
        variable(0x1001, 0, "Error register", u8, "ro", 0),
        variable(0x1017, 0, "Producer heartbeat time", u16, "rw", 50),
        variable(0x603F, 0, "Error code", u16, "ro", 0),
        variable(0x6040, 0, "Controlword", u16, "rw", 0),
        variable(0x6041, 0, "Statusword", u16, "ro", 0x0240),
        variable(0x6060, 0, "Modes of operation", datatypes.INTEGER8, "rw", 0),
        variable(0x6061, 0, "Modes of operation display", datatypes.INTEGER8, "ro", 0),
        variable(0x6083, 0, "Profile acceleration", u32, "rw", 0),
        variable(0x6084, 0, "Profile deceleration", u32, "rw", 0),
        variable(0x60FF, 0, "Target velocity", datatypes.INTEGER32, "rw", 0),
    ):
        objects.add_object(entry)
    identity = ODRecord("Identity object", 0x1018)
    identity.add_member(variable(0x1018, 0, "Highest sub-index", u8, "ro", 1))
    identity.add_member(variable(0x1018, 1, "Vendor-ID", u32, "ro", 1))
    objects.add_object(identity)
    return objects
