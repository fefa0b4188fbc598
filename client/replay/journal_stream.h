#pragma once

// A journal as the sequence of what a client shows, tick by tick, with a second read ahead.
//
// next_tick() hands out all messages of one tick together: their order in the file does not matter.
// Snapshots, inputs and the organ are skipped. Messages are not parsed here, only bounded: one may
// have 16 MiB, those of one tick 64 MiB. A damaged chunk is logged and skipped; the hole shows as
// frames whose baseline is missing. Memory: the index, one second of messages (at most 8 MiB and a
// tick), and the chunks being read. One thread; reading blocks for the chunks it needs.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/tick.h"
#include "common/journal/mcap_reader.h"
#include "common/journal/session_journal.h"

namespace trocar::replay {

class JournalStream {
 public:
  struct Entry {
    journal::JournalTopic topic;
    Tick tick;
    std::size_t offset, size;  // into the read-ahead; bytes_of() gives the view
  };
  struct Found {
    Tick tick;
    Bytes data;
  };

  // Fails if there is no keyframe in the file: then there is nothing to show.
  static Result<std::unique_ptr<JournalStream>> open(const std::string& path);

  const std::string& path() const { return mcap_->path(); }
  const journal::SessionInfo& info() const { return info_; }
  Tick first_tick() const { return first_tick_; }  // of the first keyframe
  Tick last_tick() const { return info_.last_tick; }

  // The next messages are those of the first tick at or after `tick`.
  void rewind(Tick tick);
  // Messages of the next tick that has any, if it is at or before `up_to`; else nothing. Valid
  // until the next call of any member that is not const.
  Result<std::span<const Entry>> next_tick(Tick up_to);
  BytesView bytes_of(const Entry& entry) const {
    return BytesView(bytes_).subspan(entry.offset, entry.size);
  }

  // The latest message of a topic at or before `tick` that can be read. Keeps the read-ahead.
  std::optional<Found> last_before(journal::JournalTopic topic, Tick tick);

  // Makes the error of a message that is not what its topic says.
  Error malformed(journal::JournalTopic topic, Tick tick, const std::string& what) const;

 private:
  explicit JournalStream(journal::SessionInfo info) : info_(std::move(info)) {}
  Status find_channels();
  Status find_first_key();
  Status read_ahead();
  void note_damage(const Error& damage);
  journal::TimeRange range(Tick from, Tick to) const;

  journal::SessionInfo info_;
  journal::JournalTimes times_;
  std::unique_ptr<journal::McapReader> mcap_;
  std::vector<std::optional<journal::JournalTopic>> topics_;  // by channel id
  Tick first_tick_ = 0;
  Tick read_from_ = 0;  // where the next read starts; past last_tick() at the end
  std::vector<Entry> entries_;
  std::size_t next_entry_ = 0;
  Bytes bytes_;
  std::string last_damage_;
};

}  // namespace trocar::replay
