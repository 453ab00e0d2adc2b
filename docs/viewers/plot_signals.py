import json, sys, matplotlib.pyplot as plt
from mcap.reader import make_reader
curves = {}
for schema, channel, message in make_reader(open(sys.argv[1], "rb")).iter_messages():
    if "value" in json.loads(schema.data)["properties"]:
        curves.setdefault(channel.topic, []).append((message.log_time * 1e-9, json.loads(message.data)["value"]))
figure, axes = plt.subplots(len(curves), sharex=True, figsize=(8, 1.1 * len(curves)), squeeze=False, layout="constrained")
for (topic, points), axis in zip(sorted(curves.items()), axes[:, 0]):
    axis.plot(*zip(*points), ".", markersize=1); axis.set_title(topic, fontsize=6, loc="left")
figure.savefig(sys.argv[2])
