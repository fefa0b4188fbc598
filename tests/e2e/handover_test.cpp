// An instructor hands over, over the network, what one hand has grasped to another: the tissue is
// never let go, though the giver leaves, and the recording verifies.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>

#include "client/net/net_source.h"
#include "common/base/tick.h"
#include "common/journal/session_journal.h"
#include "common/secure/link_file.h"
#include "common/secure/stream.h"
#include "proto/wire.pb.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

constexpr std::uint32_t kAnnas = 0, kBens = 2;  // tool slots: Anna joins first
constexpr Tick kAll = std::numeric_limits<Tick>::max();

std::filesystem::path write_script(const std::filesystem::path& folder, const std::string& name,
                                   int height_mm, const std::string& verb) {
  const auto file = folder / (name + ".toml");
  std::ofstream out(file);
  out << "[[tool]]\nreach_mm = 16\nanchor = [0, -1, 0.9]\nanchor_on = \"extreme\"\n";
  for (const int time_s : {0, 120})
    out << "[[tool.key]]\ntime_s = " << time_s << "\nposition_mm = [0, 0, " << height_mm
        << "]\nshaft = [-0.6, -0.25, 1]\nverb = \"" << verb << "\"\n";
  return file;
}

std::vector<proto::ClaimEvent> grasps(const std::filesystem::path& file) {
  std::vector<proto::ClaimEvent> events;
  auto journal = journal::SessionJournal::open(file.string());
  if (!journal.ok()) return events;  // nothing is recorded yet
  (void)(*journal)->read_claims(0, kAll, [&](Tick, const proto::ClaimLog& log) {
    for (const auto& event : log.event())
      if (event.verb() == proto::VERB_GRASP) events.push_back(event);
    return true;
  });
  return events;
}

const proto::ClaimEvent* find(const std::vector<proto::ClaimEvent>& events, std::uint32_t tool,
                              proto::ClaimOutcome outcome) {
  for (const auto& event : events)
    if (event.tool() == tool && event.outcome() == outcome) return &event;
  return nullptr;
}

// Hears what an instructor is told, and acknowledges nothing.
class Instructor final : public replica::MessageSink {
 public:
  explicit Instructor(const std::string& address) : source_(options(address)) {}

  void on_message(const proto::Envelope& message, std::uint64_t, std::size_t) override {
    if (message.has_teach_event()) told_ = message.teach_event();
  }
  bool is_live() {
    source_.poll(*this);
    return source_.state() == replica::SourceState::Live;
  }
  // Returns what becomes of it; nothing: no answer came.
  std::optional<proto::TeachEvent> hand_over(const std::string& giver,
                                             const std::string& receiver) {
    proto::Envelope envelope;
    auto& request = *envelope.mutable_teach_request();
    request.set_action(proto::TEACH_HAND_OVER);
    request.set_participant(kAnnas / kToolsPerHand);
    request.set_name(giver);
    request.set_receiver(kBens / kToolsPerHand);
    request.set_receiver_name(receiver);
    told_.reset();
    source_.send(envelope);
    wait_until([this] { return is_live(), told_.has_value(); }, 30);
    return told_;
  }

 private:
  static net::NetSourceOptions options(const std::string& address) {
    net::NetSourceOptions options;
    options.port = static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1)));
    options.participant_name = "Ivy";
    options.role = proto::ROLE_INSTRUCTOR;
    options.acks_every_frame = false;
    options.tls = secure::make_client_context();
    options.join_code = [port = options.port] {
      return secure::read_link_file(port, "instructor");
    };
    return options;
  }

  std::optional<proto::TeachEvent> told_;
  net::NetSource source_;
};

TEST(Handover, TissueStaysHeldWhileItsInstrumentChangesHands) {
  Session session("elastic-liver");
  auto anna = session.hand("Anna", write_script(session.folder, "anna", 0, "grasp"));
  const auto is_granted = [&](std::uint32_t tool) {
    return find(grasps(session.journal), tool, proto::CLAIM_GRANTED) != nullptr;
  };
  ASSERT_TRUE(wait_until([&] { return is_granted(kAnnas); }, 60));
  auto ben = session.hand("Ben", write_script(session.folder, "ben", 80, "none"));
  Instructor ivy(session.address());
  ASSERT_TRUE(wait_until([&] { return ivy.is_live(); }, 30));
  std::optional<proto::TeachEvent> told;
  // Until Ben is there, too.
  ASSERT_TRUE(wait_until(
      [&] {
        told = ivy.hand_over("Anna", "Ben");
        return told && told->is_done();
      },
      60))
      << (told ? told->text() : "no answer");
  EXPECT_EQ(told->tool(), kAnnas);
  EXPECT_EQ(told->receiver_tool(), kBens);
  ASSERT_TRUE(wait_until([&] { return is_granted(kBens); }, 60));
  anna.signal(SIGTERM);
  EXPECT_EQ(anna.wait(20), 0);
  const auto granted = grasps(session.journal);
  const Tick tick = find(granted, kBens, proto::CLAIM_GRANTED)->tick();
  ASSERT_TRUE(session.wait_for_tick(tick + 4000)) << "longer than any lease";
  session.server().signal(SIGTERM);
  EXPECT_EQ(session.server().wait(30), 0);
  EXPECT_EQ(ben.wait(20), 0);

  const auto events = grasps(session.journal);
  const auto* released = find(events, kAnnas, proto::CLAIM_RELEASED);
  ASSERT_NE(released, nullptr);
  EXPECT_EQ(released->tick(), tick) << "as one";
  for (const auto outcome : {proto::CLAIM_RELEASED, proto::CLAIM_SLIPPED, proto::CLAIM_EXPIRED})
    EXPECT_EQ(find(events, kBens, outcome), nullptr) << proto::ClaimOutcome_Name(outcome);
  bool is_recorded = false;
  auto journal = journal::SessionJournal::open(session.journal.string());
  ASSERT_TRUE(journal.ok());
  EXPECT_TRUE((*journal)
                  ->read_lessons(0, kAll,
                                 [&](Tick, const proto::LessonRecord& record) {
                                   is_recorded |= record.has_teach() &&
                                                  record.teach().action() == proto::TEACH_HAND_OVER;
                                   return true;
                                 })
                  .ok());
  EXPECT_TRUE(is_recorded);
  Program verify("trocar-journal", {"verify", session.journal}, session.folder / "verify.log");
  EXPECT_EQ(verify.wait(300), 0) << read_text(session.folder / "verify.log");
}

}  // namespace
}  // namespace trocar::e2e
