// Reads a recording completely, twice: record by record with every CRC checked, and by its index.
//
//   node read.cjs RUN_0.mcap
//
// Prints one JSON object: profile, streamed and indexed (numbers of messages), and for each topic its type, its
// number of messages and its last message, decoded by the recorded schema alone. Fails on the first error.
"use strict";

const fs = require("node:fs/promises");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { decompress } = require("fzstd");

const decompressHandlers = { zstd: (data, size) => decompress(data, new Uint8Array(Number(size))) };

// JSON has no integers of 64 bits, and no typed arrays.
function plain(_key, value) {
  if (typeof value === "bigint") return value.toString();
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
}

async function main(path) {
  const data = await fs.readFile(path);
  const result = { profile: undefined, streamed: 0, indexed: 0, topics: {} };

  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(data);
  for (let record; (record = stream.nextRecord()); ) {
    if (record.type === "Header") result.profile = record.profile;
    if (record.type === "Message") result.streamed++;
  }
  if (!stream.done()) throw new Error("the file has no end");

  const readable = {
    size: async () => BigInt(data.byteLength),
    read: async (offset, length) => new Uint8Array(data.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const messageReaders = new Map();
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (channel.messageEncoding !== "cdr" || schema.encoding !== "ros2msg") throw new Error("not a ROS 2 recording");
    if (!messageReaders.has(channel.id)) {
      const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
      messageReaders.set(channel.id, new MessageReader(definitions));
    }
    const topic = (result.topics[channel.topic] ??= { type: schema.name, messages: 0, last: undefined });
    topic.last = messageReaders.get(channel.id).readMessage(message.data);
    topic.messages++;
    result.indexed++;
  }
  process.stdout.write(JSON.stringify(result, plain) + "\n");
}

main(process.argv[2]).catch((error) => {
  console.error(error);
  process.exit(1);
});
