// Foxglove's own client library at a live dashboard.
//
//   foxglove.cjs read ADDRESS TOKEN SECONDS     what is advertised and sent, as one JSON document
//   foxglove.cjs late ADDRESS TOKEN SECONDS     the same, with subscriptions that begin in the middle of that time
//   foxglove.cjs doors ADDRESS TOKEN ORIGIN     the status of handshakes, right and wrong; ORIGIN is one that is admitted
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

const [what, address, token, last] = process.argv.slice(2);
const text = new TextDecoder();
const url = `ws://${address}/foxglove?token=${token}`;

function read(seconds, after) {
  const seen = { info: null, topics: [], statuses: [], messages: {}, errors: [] };
  const socket = new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
  const client = new FoxgloveClient({ ws: socket });
  const names = new Map();
  client.on("error", (error) => seen.errors.push(String(error)));
  client.on("serverInfo", (info) => (seen.info = info));
  client.on("status", (status) => seen.statuses.push(status.message));
  client.on("advertise", (channels) => {
    seen.topics.push(...channels);
    setTimeout(() => {
      for (const channel of channels) names.set(client.subscribe(channel.id), channel.topic);
    }, after);
  });
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const topic = names.get(subscriptionId);
    (seen.messages[topic] ??= []).push([String(timestamp), JSON.parse(text.decode(data))]);
  });
  setTimeout(() => {
    // A pipe takes a long document piece by piece.
    process.stdout.write(JSON.stringify(seen), () => process.exit(0));
  }, 1000 * seconds);
}

function door(name, url, protocols, options = {}) {
  return new Promise((done) => {
    const socket = new WebSocket(url, protocols, options);
    const end = (status, protocol) => {
      done([name, status, protocol ?? null]);
      socket.terminate();
    };
    socket.on("open", () => end(101, socket.protocol));
    socket.on("unexpected-response", (_, response) => end(response.statusCode));
    socket.on("error", () => {});
  });
}

async function doors(origin) {
  const [newer, older] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
  const place = `ws://${address}`;
  const seen = await Promise.all([
    door("newer", url, [newer, older]),
    door("older", url, [older]),
    door("no subprotocol", url, []),
    door("another subprotocol", url, ["chat"]),
    door("no token", `${place}/foxglove`, [newer]),
    door("wrong token", `${place}/foxglove?token=${"0".repeat(64)}`, [newer]),
    door("no such run", `${place}/foxglove/none?token=${token}`, [newer]),
    door("wrong origin", url, [newer], { origin: "https://evil.example" }),
    door("admitted origin", url, [newer], { origin }),
    door("admitted origin without token", `${place}/foxglove`, [newer], { origin }),
    door("admitted origin elsewhere", `${place}/api/live/live`, ["muprime", token], { origin }),
    door("wrong host", url, [newer], { headers: { Host: "evil.example" } }),
    door("token in the address elsewhere", `${place}/api/live/live?token=${token}`, []),
  ]);
  console.log(JSON.stringify(Object.fromEntries(seen.map(([name, ...rest]) => [name, rest]))));
}

if (what === "doors") doors(last);
else read(Number(last), what === "late" ? 500 * Number(last) : 0);
