// Reads a journal with the MCAP project's own library and checks it:
//   node check_journal.mjs FILE [--modules FOLDER] [--json]
// Indexed reading with CRC validation, a seek by time, counts against Statistics, then the whole file
// as a stream; both ways must give the same messages. An unfinished journal (after a crash) has no
// index and is read as a stream only. Exit code 0 sound, 1 not, 2 usage.

import { open, readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { createHash } from "node:crypto";
import path from "node:path";
import process from "node:process";
import { fileURLToPath } from "node:url";

const TAIL_MAGIC = Buffer.from([0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a]);

function parseArguments(argv) {
  const options = { file: undefined, modules: path.dirname(fileURLToPath(import.meta.url)), json: false };
  for (let i = 0; i < argv.length; ++i) {
    if (argv[i] === "--modules") options.modules = argv[++i];
    else if (argv[i] === "--json") options.json = true;
    else options.file = argv[i];
  }
  return options;
}

function expect(condition, text) {
  if (!condition) throw new Error(text);
}

// The same bytes in both readings: channel, time, sequence and data, in order of log time.
class Digest {
  constructor() {
    this.perTopic = new Map();
    this.count = 0n;
  }
  add(topic, message) {
    let entry = this.perTopic.get(topic);
    if (!entry) this.perTopic.set(topic, (entry = { count: 0n, hash: createHash("sha256") }));
    entry.hash.update(`${message.logTime} ${message.publishTime} ${message.sequence} `);
    entry.hash.update(message.data);
    entry.count += 1n;
    this.count += 1n;
  }
  result() {
    return new Map([...this.perTopic].sort().map(([topic, entry]) => [
      topic, { count: entry.count, hash: entry.hash.copy().digest("hex") },
    ]));
  }
}

async function readIndexed(mcap, handlers, file) {
  const handle = await open(file, "r");
  let reads = 0;
  const readable = {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, size) => {
      const buffer = new Uint8Array(Number(size));
      const { bytesRead } = await handle.read(buffer, 0, buffer.length, Number(offset));
      expect(bytesRead === buffer.length, `read ${bytesRead} of ${size} bytes at ${offset}`);
      ++reads;
      return buffer;
    },
  };
  try {
    const reader = await mcap.McapIndexedReader.Initialize({ readable, decompressHandlers: handlers });
    const statistics = reader.statistics;
    expect(statistics !== undefined, "no Statistics record");
    expect(reader.chunkIndexes.length === statistics.chunkCount, "chunk count differs from Statistics");
    expect(reader.dataSectionCrc !== 0, "no CRC over the data section");

    const digest = new Digest();
    const perChannel = new Map();
    let last = 0n;
    for await (const message of reader.readMessages({ validateCrcs: true })) {
      expect(message.logTime >= last, `log time goes back at ${message.logTime}`);
      last = message.logTime;
      digest.add(reader.channelsById.get(message.channelId).topic, message);
      perChannel.set(message.channelId, (perChannel.get(message.channelId) ?? 0n) + 1n);
    }
    expect(digest.count === statistics.messageCount,
      `${digest.count} messages, Statistics says ${statistics.messageCount}`);
    expect(perChannel.size === statistics.channelMessageCounts.size, "channels differ from Statistics");
    for (const [channel, count] of perChannel)
      expect(statistics.channelMessageCounts.get(channel) === count, `count of channel ${channel}`);
    expect(digest.count === 0n || last === statistics.messageEndTime, "end time differs");

    const metadata = [];
    for await (const record of reader.readMetadata()) metadata.push(record.name);
    expect(metadata.length === statistics.metadataCount, "metadata count differs from Statistics");
    const seek = await checkSeek(reader, statistics, () => reads);
    return { reader, digest, seek, metadata };
  } finally {
    await handle.close();
  }
}

// A tenth of the recording, from its middle: as many messages as reading all and choosing.
async function checkSeek(reader, statistics, readCount) {
  const length = statistics.messageEndTime - statistics.messageStartTime;
  const startTime = statistics.messageStartTime + length / 2n;
  const endTime = startTime + length / 10n;
  let expected = 0;
  for await (const message of reader.readMessages())
    if (message.logTime >= startTime && message.logTime <= endTime) ++expected;
  const before = readCount();
  let found = 0;
  for await (const message of reader.readMessages({ startTime, endTime, validateCrcs: true })) {
    expect(message.logTime >= startTime && message.logTime <= endTime, "message outside the range");
    ++found;
  }
  expect(found === expected, `seek found ${found} messages, expected ${expected}`);
  return { messages: found, reads: readCount() - before };
}

async function readStream(mcap, handlers, file, isFinished) {
  const reader = new mcap.McapStreamReader({ decompressHandlers: handlers, validateCrcs: true });
  reader.append(await readFile(file));
  const digest = new Digest();
  const topics = new Map();
  const schemas = new Set();
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") schemas.add(record.id);
    if (record.type === "Channel") {
      expect(record.schemaId === 0 || schemas.has(record.schemaId), `schema of ${record.topic} comes late`);
      topics.set(record.id, record.topic);
    }
    if (record.type === "Message") digest.add(topics.get(record.channelId), record);
  }
  if (isFinished) expect(reader.done(), "stream does not end with footer and magic");
  return digest;
}

async function isFinishedFile(file) {
  const handle = await open(file, "r");
  try {
    const { size } = await handle.stat();
    const tail = Buffer.alloc(8);
    if (size >= 16) await handle.read(tail, 0, 8, size - 8);
    return tail.equals(TAIL_MAGIC);
  } finally {
    await handle.close();
  }
}

async function main() {
  const options = parseArguments(process.argv.slice(2));
  if (!options.file) {
    console.error("check_journal: usage: node check_journal.mjs FILE [--modules FOLDER] [--json]");
    return 2;
  }
  const require = createRequire(path.join(path.resolve(options.modules), "package.json"));
  const mcap = require("@mcap/core");
  const fzstd = require("fzstd");
  const handlers = { zstd: (data, size) => fzstd.decompress(data, new Uint8Array(Number(size))) };

  const isFinished = await isFinishedFile(options.file);
  const streamed = await readStream(mcap, handlers, options.file, isFinished);
  const report = { file: options.file, finished: isFinished, messages: Number(streamed.count) };
  if (isFinished) {
    const { reader, digest, seek, metadata } = await readIndexed(mcap, handlers, options.file);
    const byIndex = digest.result();
    const byStream = streamed.result();
    expect(byIndex.size === byStream.size, "indexed and streamed reading found different topics");
    for (const [topic, entry] of byStream)
      expect(byIndex.get(topic)?.hash === entry.hash, `indexed and streamed reading differ on ${topic}`);
    Object.assign(report, {
      profile: reader.header.profile, library: reader.header.library, metadata,
      chunks: reader.chunkIndexes.length, seek,
    });
  }
  report.topics = Object.fromEntries([...streamed.result()].map(([t, e]) => [t, Number(e.count)]));
  if (options.json) console.log(JSON.stringify(report, null, 2));
  else console.log(`check_journal: ${options.file}: sound, ${report.messages} messages on ` +
    `${Object.keys(report.topics).length} topics` +
    (isFinished ? `, ${report.chunks} chunks, indexed and streamed reading agree` : ", unfinished"));
  return 0;
}

main().then((code) => { process.exitCode = code; }, (error) => {
  console.error(`check_journal: ${process.argv[2]}: ${error.message}`);
  process.exitCode = 1;
});
