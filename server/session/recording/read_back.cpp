#include "server/session/recording/read_back.h"

#include <fmt/format.h>

#include "common/journal/session_journal.h"
#include "proto/journal.pb.h"
#include "server/session/recording/stored_surface.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

class ReadBack {
 public:
  ReadBack(std::string path, Tick begin) : path_(std::move(path)), last_(begin) {}

  bool take(std::string_view topic, Tick tick, BytesView bytes) {
    const auto known = journal::topic_of(topic);
    if (known == JournalTopic::Overview) return true;
    ++messages_;
    if (!known) return true;
    switch (*known) {
      case JournalTopic::TickBatch:
        return with(proto::TickBatch(), tick, bytes, [this](const auto& m) { check_ticks(m); });
      case JournalTopic::Gap:
        return with(proto::JournalGap(), tick, bytes, [this](const auto& gap) {
          if (!gap.is_join()) last_ = std::max(last_, gap.last_tick());
          has_gap_ |= !gap.is_join();
          surface_.skip();
        });
      case JournalTopic::Topology:
        return check_surface(proto::SurfaceTopology(), tick, bytes);
      case JournalTopic::TopologyChange:
        return check_surface(proto::SurfaceChange(), tick, bytes);
      case JournalTopic::SurfaceKey:
      case JournalTopic::SurfaceDelta:
        return check_surface(proto::SurfaceFrame(), tick, bytes);
      default:
        return true;
    }
  }

  Status status(const Written& written) const {
    if (!status_) return status_;
    if (messages_ != written.messages)
      return wrong(fmt::format("has {} messages, {} were written", messages_, written.messages));
    if (!has_gap_ && surface_.undecodable() > 0)
      return wrong(fmt::format("{} surfaces lack what comes before them", surface_.undecodable()));
    return {};
  }
  Error wrong(const std::string& what) const {
    return {ErrorCode::BadFile, path_ + ": read back: " + what};
  }

 private:
  template <typename Message, typename Use>
  bool with(Message message, Tick tick, BytesView bytes, const Use& use) {
    if (message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
      use(message);
    else
      status_ = wrong(fmt::format("a message at tick {} cannot be read", tick));
    return status_.ok();
  }
  template <typename Message>
  bool check_surface(Message message, Tick tick, BytesView bytes) {
    return with(std::move(message), tick, bytes, [&](const auto& m) {
      if (const auto difference = surface_.check(m))
        status_ = wrong(fmt::format("the surface at tick {}: {} is {}, and should be {}", tick,
                                    difference->field, difference->recorded, difference->found));
    });
  }
  void check_ticks(const proto::TickBatch& batch) {
    for (const auto& record : batch.record()) {
      if (record.tick() != last_ + 1 && status_.ok())
        status_ = wrong(fmt::format("tick {} follows tick {}", record.tick(), last_));
      last_ = record.tick();
    }
  }

  std::string path_;
  StoredSurface surface_;
  Tick last_ = 0;
  std::uint64_t messages_ = 0;
  bool has_gap_ = false;
  Status status_;
};

}  // namespace

Status read_back(const std::string& path, const Written& written) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  ReadBack reader(path, written.begin);
  if (!(*journal)->container().is_finished()) return reader.wrong("it has no sound summary");
  if ((*journal)->info().last_tick != written.end)
    return reader.wrong(fmt::format("it ends at tick {}, tick {} was written",
                                    (*journal)->info().last_tick, written.end));
  if (auto organ = (*journal)->organ(); !organ) return organ.error();
  const auto report = (*journal)->read_all([&](std::string_view topic, Tick tick, BytesView bytes) {
    return reader.take(topic, tick, bytes);
  });
  if (auto status = report.status(); !status) return status;
  return reader.status(written);
}

}  // namespace trocar::recording
