#pragma once

// The end of a recording says what the whole holds: how many messages each channel has, and a
// SHA-256 of all of them, so that a part which somebody took out is missed though the file was
// closed anew. It is metadata that the writer puts before the summary; metadata trocar.session
// promises it.
//
//   trocar.end        messages          how many there are
//                     /topic            how many there are on that channel
//                     messages_sha256   of topic, log_time, publish_time and bytes, in order
//                     metadata_sha256   of all other metadata, in order
//   trocar.signature  ed25519           of signed_bytes(end), in hexadecimal
//                     public_key        by which it can be checked; nothing says whose that is
//
// Nobody but who has the key can sign; an end alone can be made anew by whoever knows this page.

#include <map>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/journal/mcap_reader.h"
#include "common/secure/signing.h"

namespace trocar::journal {

inline constexpr const char* kEndMetadataName = "trocar.end";
inline constexpr const char* kSignatureMetadataName = "trocar.signature";
inline constexpr const char* kPromisedEnd = "end";  // an entry of trocar.session

// Metadata that are written anew for each file, and are no part of what they count.
bool is_of_end(const McapMetadata& metadata);

// Adds up what a recording holds, in the order in which it is written.
class ContentSum {
 public:
  void add(const McapMetadata& metadata);
  void add(std::string_view topic, std::uint64_t log_time, std::uint64_t publish_time,
           BytesView data);
  McapMetadata end() const;

 private:
  std::uint64_t messages_ = 0;
  std::map<std::string, std::uint64_t, std::less<>> counts_;  // by topic
  secure::RunningSha256 message_hash_, metadata_hash_;
  Bytes scratch_;
};

McapMetadata sign(const McapMetadata& end, const secure::SigningKey& key);

enum class EndStatus {
  Right,
  Unpromised,  // of an older version: what is missing at the end cannot be known
  Unfinished,  // its writer was killed
  Wrong,       // the file was changed since, or is damaged
};

struct EndReport {
  EndStatus status = EndStatus::Right;
  std::string text;  // why it is not right, without the file's name; empty: it is
  ReadReport read;   // of check_end()
};

// Compares the end with the summary's counts. Reads no message.
EndReport check_counts(const McapReader& reader);
// Compares it with all that is there.
EndReport check_end(McapReader& reader);
// An error if a recording is to be copied that is not what its end says: the copy would get a right
// end.
Status refuse_wrong_end(McapReader& reader);

// An error if anything in a recording is not as the owner of the key signed it. key_file: for
// words.
Status check_signature(McapReader& reader, const secure::PublicKey& key,
                       const std::string& key_file);

}  // namespace trocar::journal
