#include "common/journal/recording_end.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "common/base/printable.h"
#include "common/journal/session_topics.h"

namespace trocar::journal {
namespace {

constexpr const char* kMessages = "messages";
constexpr const char* kMessageHash = "messages_sha256";
constexpr const char* kMetadataHash = "metadata_sha256";
constexpr const char* kSignature = "ed25519";
constexpr const char* kPublicKey = "public_key";
// The signed bytes begin with it, so that no signature of anything else counts.
constexpr std::string_view kSignedHere = "trocar-recording-1\n";

using Counts = std::map<std::string, std::uint64_t, std::less<>>;

std::string entry_of(const McapMetadata& metadata, const char* key) {
  const auto found = metadata.entries.find(key);
  return found == metadata.entries.end() ? std::string() : found->second;
}

// The metadata of that name; nothing if there are none or several.
const McapMetadata* only(const McapReader& reader, const char* name) {
  const McapMetadata* found = nullptr;
  for (const auto& metadata : reader.metadata()) {
    if (metadata.name != name) continue;
    if (found != nullptr) return nullptr;
    found = &metadata;
  }
  return found;
}

std::optional<std::uint64_t> number_of(const std::string& text) {
  std::uint64_t number = 0;
  const char* end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || stopped != end) return std::nullopt;
  return number;
}

// Why those counts are not what the end says; empty: they are.
std::string differing(const McapMetadata& end, const Counts& counts) {
  const auto changed = [](const std::string& topic, std::uint64_t there, const std::string& said) {
    return printable(topic) + ": " + std::to_string(there) +
           " messages, the end of the recording counts " + printable(said) +
           ": it was changed since";
  };
  for (const auto& [topic, said] : end.entries) {
    if (!topic.starts_with("/")) continue;
    const auto found = counts.find(topic);
    const auto there = found == counts.end() ? 0 : found->second;
    if (number_of(said) != there) return changed(topic, there, said);
  }
  std::uint64_t all = 0;
  for (const auto& [topic, there] : counts) {
    if (there > 0 && !end.entries.contains(topic)) return changed(topic, there, "0");
    all += there;
  }
  const auto said = entry_of(end, kMessages);
  return number_of(said) == all ? std::string() : changed(kMessages, all, said);
}

// Says what is known without looking at messages; nothing: there is an end to compare with.
std::optional<EndReport> without_end(const McapReader& reader) {
  if (only(reader, kEndMetadataName) != nullptr) return std::nullopt;
  const auto* session = only(reader, kSessionMetadataName);
  if (!reader.is_finished()) return EndReport{EndStatus::Unfinished, "it has no end", {}};
  if (session != nullptr && session->entries.contains(kPromisedEnd))
    return EndReport{EndStatus::Wrong,
                     "the end that counts its messages was taken out: it was changed since",
                     {}};
  return EndReport{EndStatus::Unpromised,
                   "an older version recorded it, whose recordings do not count their messages: "
                   "whether some are missing at the end cannot be checked",
                   {}};
}

Bytes signed_bytes(const McapMetadata& end) {
  Bytes bytes(kSignedHere.begin(), kSignedHere.end());
  put_metadata(bytes, end);
  return bytes;
}

}  // namespace

bool is_of_end(const McapMetadata& metadata) {
  return metadata.name == kEndMetadataName || metadata.name == kSignatureMetadataName;
}

void ContentSum::add(const McapMetadata& metadata) {
  if (is_of_end(metadata)) return;
  scratch_.clear();
  put_metadata(scratch_, metadata);
  metadata_hash_.update(scratch_);
}

void ContentSum::add(std::string_view topic, std::uint64_t log_time, std::uint64_t publish_time,
                     BytesView data) {
  ++messages_;
  const auto counted = counts_.find(topic);
  if (counted != counts_.end())
    ++counted->second;
  else
    counts_.emplace(topic, 1);
  scratch_.clear();
  ByteWriter writer(scratch_);
  writer.put(std::uint64_t{topic.size()});
  writer.put_bytes(bytes_of(topic));
  writer.put(log_time);
  writer.put(publish_time);
  writer.put(std::uint64_t{data.size()});
  message_hash_.update(scratch_);
  message_hash_.update(data);
}

McapMetadata ContentSum::end() const {
  McapMetadata end{kEndMetadataName,
                   {{kMessages, std::to_string(messages_)},
                    {kMessageHash, secure::to_hex(message_hash_.digest())},
                    {kMetadataHash, secure::to_hex(metadata_hash_.digest())}}};
  for (const auto& [topic, count] : counts_) end.entries[topic] = std::to_string(count);
  return end;
}

McapMetadata sign(const McapMetadata& end, const secure::SigningKey& key) {
  return {kSignatureMetadataName,
          {{kSignature, secure::to_hex(key.sign(signed_bytes(end)))},
           {kPublicKey, secure::to_hex(key.public_key())}}};
}

EndReport check_counts(const McapReader& reader) {
  if (auto report = without_end(reader)) return *report;
  Counts counts;
  for (const auto& [id, count] : reader.statistics().channel_message_counts)
    if (const auto channel = reader.channels().find(id); channel != reader.channels().end())
      counts[channel->second.topic] += count;
  const auto wrong = differing(*only(reader, kEndMetadataName), counts);
  return {wrong.empty() ? EndStatus::Right : EndStatus::Wrong, wrong, {}};
}

EndReport check_end(McapReader& reader) {
  ContentSum sum;
  for (const auto& metadata : reader.metadata()) sum.add(metadata);
  Counts counts;
  auto read = reader.read({}, {}, [&](const McapMessage& message) {
    const auto& topic = reader.channels().at(message.channel_id).topic;
    ++counts[topic];
    sum.add(topic, message.log_time, message.publish_time, message.data);
    return true;
  });
  if (!read.status()) return {EndStatus::Wrong, read.first_damage.message, read};
  if (auto report = without_end(reader)) {
    report->read = read;
    return *report;
  }
  const auto& end = *only(reader, kEndMetadataName);
  auto wrong = differing(end, counts);
  const auto found = sum.end();
  for (const auto* hash : {kMessageHash, kMetadataHash})
    if (wrong.empty() && entry_of(found, hash) != entry_of(end, hash))
      wrong = std::string(hash) + ": is " + entry_of(found, hash) +
              ", the end of the recording says " + printable(entry_of(end, hash)) +
              ": it was changed since";
  return {wrong.empty() ? EndStatus::Right : EndStatus::Wrong, wrong, read};
}

Status refuse_wrong_end(McapReader& reader) {
  const auto end = check_end(reader);
  if (end.status != EndStatus::Wrong) return {};
  const bool has_name = end.text.starts_with(reader.path());
  return Error{ErrorCode::BadFile, has_name ? end.text : reader.path() + ": " + end.text};
}

Status check_signature(McapReader& reader, const secure::PublicKey& key,
                       const std::string& key_file) {
  const auto wrong = [&](const std::string& why) {
    return Error{ErrorCode::Mismatch, reader.path() + ": " + why};
  };
  const auto* end = only(reader, kEndMetadataName);
  const auto* signature = only(reader, kSignatureMetadataName);
  if (end == nullptr || signature == nullptr) return wrong("is not signed");
  const auto by = secure::from_hex(entry_of(*signature, kPublicKey));
  if (!std::ranges::equal(by, key))
    return wrong("is signed with another key than that of " + key_file);
  const auto bytes = secure::from_hex(entry_of(*signature, kSignature));
  secure::Signature raw{};
  const bool has_size = bytes.size() == raw.size();
  if (has_size) std::ranges::copy(bytes, raw.begin());
  if (!has_size || !secure::is_signed_by(key, signed_bytes(*end), raw))
    return wrong("its signature is not that of its end: it was changed since it was signed");
  if (const auto found = check_end(reader); found.status != EndStatus::Right)
    return wrong("is not what was signed: " + found.text);
  return {};
}

}  // namespace trocar::journal
