// Reads a dump of `read_ros2.py` as Lichtblick and Foxglove do: what their writers make of a message
// that their readers have read has to be the same bytes.

const fs = require("fs");
const { CdrReader } = require("@foxglove/cdr");

const LITTLE_ENDIAN_CDR = 1;
const viewers = ["lichtblick", "foxglove"].map((name) => ({
  name,
  ...require(`@${name}/rosmsg`),
  ...require(`@${name}/rosmsg2-serialization`),
}));

for (const line of fs.readFileSync(process.argv[2], "utf8").trim().split("\n")) {
  const [topic, definition, messages] = JSON.parse(line);
  for (const { name, parse, MessageReader, MessageWriter } of viewers) {
    const types = parse(definition, { ros2: true });
    const reader = new MessageReader(types);
    const writer = new MessageWriter(types);
    for (const message of messages) {
      const bytes = Buffer.from(message, "base64");
      if (new CdrReader(bytes).kind !== LITTLE_ENDIAN_CDR) {
        throw new Error(`${topic}: no CDR`);
      }
      const again = Buffer.from(writer.writeMessage(reader.readMessage(bytes)));
      if (!again.equals(bytes)) {
        throw new Error(`${topic}: ${again.length} bytes for ${bytes.length} by ${name}`);
      }
    }
  }
  console.log(`${topic}: ${messages.length} by the readers of Lichtblick and Foxglove`);
}
