// Reads a dump of `read_ros2.py` as Lichtblick does: what its writer makes of a message that its
// reader has read has to be the same bytes.

const fs = require("fs");
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader, MessageWriter } = require("@lichtblick/rosmsg2-serialization");

for (const line of fs.readFileSync(process.argv[2], "utf8").trim().split("\n")) {
  const [topic, definition, messages] = JSON.parse(line);
  const types = parse(definition, { ros2: true });
  const reader = new MessageReader(types);
  const writer = new MessageWriter(types);
  for (const message of messages) {
    const bytes = Buffer.from(message, "base64");
    const again = Buffer.from(writer.writeMessage(reader.readMessage(bytes)));
    if (!again.equals(bytes)) {
      throw new Error(`${topic}: ${again.length} bytes for ${bytes.length}`);
    }
  }
  console.log(`${topic}: ${messages.length} by Lichtblick's reader`);
}
