#include "client/slicer/link.h"

#include "common/base/asio.h"  // before Boost: see there

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <cmath>

#include "client/net/net_source.h"
#include "client/replica/replica.h"
#include "client/slicer/peers.h"
#include "client/slicer/publisher.h"
#include "client/slicer/studio.h"
#include "client/slicer/tracked_tools.h"
#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/text_file.h"
#include "common/base/timing.h"
#include "common/secure/loopback.h"

namespace trocar::slicer {
namespace {

constexpr std::chrono::milliseconds kPoll{4};
constexpr std::uint64_t kGoodbyeNs = 2'500'000'000;  // longer than a source waits for that
constexpr std::chrono::milliseconds kLastWords{200};
constexpr const char* kWaiting = "waiting for a label map";

// This program's part in one session.
class Part {
 public:
  explicit Part(net::NetSourceOptions connection)
      : source_(std::move(connection)),
        replica_([this](const proto::Envelope& message) { return source_.send(message); }) {}
  ~Part() {
    source_.close("the link ends");
    const auto until = monotonic_ns() + kGoodbyeNs;
    while (source_.state() != replica::SourceState::Closed && monotonic_ns() < until) {
      source_.poll(replica_);
      std::this_thread::sleep_for(kPoll);
    }
  }

  net::NetSource& source() { return source_; }
  const replica::Replica& replica() const { return replica_; }
  void poll() { source_.poll(replica_); }
  bool is_over() const {
    return source_.state() == replica::SourceState::Closed || !replica_.fault().ok();
  }
  std::string why_over() const {
    return replica_.fault().ok() ? source_.close_reason().text : replica_.fault().error().message;
  }
  Condition condition() const;
  std::string text() const;

 private:
  net::NetSource source_;
  replica::Replica replica_;
};

Condition Part::condition() const {
  return source_.state() == replica::SourceState::Live && replica_.newest() != nullptr
             ? Condition::Fine
             : Condition::NotReady;
}

std::string Part::text() const {
  if (source_.state() == replica::SourceState::Away)
    return "the connection to the session is broken, and is being made again";
  if (condition() != Condition::Fine) return "looking for the session at " + source_.name();
  const auto& told = replica_.told();
  return fmt::format("{}, {:.0f} s, {} there{}", replica_.topology().organ_name,
                     static_cast<double>(replica_.newest()->tick) * kTickSeconds,
                     told.participants().size(), told.pace().is_paused ? ", paused" : "");
}

class Link {
 public:
  explicit Link(const LinkOptions& options);

  Result<ExitCode> run();

 private:
  Status begin();
  Status join(std::uint16_t port);  // 0: as --server says
  void hear(PeerMessage message);
  Status take_tool_message(const PeerMessage& message);
  void step();
  void say(Condition condition, const std::string& text);
  void note_organ(const std::filesystem::path& organ, const Vec3d& offset_m);
  Result<ExitCode> end();

  const LinkOptions& options_;
  asio::io_context context_{1};
  asio::signal_set signals_{context_};
  bool is_stopped_ = false;
  Frames frames_;
  TrackedTools tools_;
  Peers peers_;
  Publisher publisher_;
  Studio studio_;
  std::unique_ptr<Part> part_;  // null: there is no session yet
  Condition condition_ = Condition::NotReady;
  std::string text_;
  std::uint64_t end_ns_ = 0;  // 0: never
  std::optional<Error> failure_;
};

Link::Link(const LinkOptions& options)
    : options_(options),
      frames_(options.offset_m),
      tools_(options.tools),
      peers_(context_, {.heard = [this](PeerMessage message) { hear(std::move(message)); },
                        .gone = [this](PeerId peer) { tools_.let_go(peer); }}),
      publisher_(options.publish,
                 {.put = [this](const std::string& key,
                                SharedBytes bytes) { peers_.publish(key, std::move(bytes)); },
                  .take_down = [this](const std::string& key) { peers_.retract(key); }}),
      studio_(options.studio,
              {.said = [this](const std::string& text) { say(Condition::Busy, text); },
               .failed =
                   [this](PeerId peer, const Error& error) {
                     if (!part_) say(Condition::NotReady, kWaiting);
                     if (peer == 0) failure_ = error;
                     peers_.blame(peer, error);
                   },
               .made = [this](const std::filesystem::path& organ,
                              const Vec3d& offset_m) { note_organ(organ, offset_m); },
               .serving =
                   [this](std::uint16_t port) {
                     if (const auto joined = join(port); !joined) failure_ = joined.error();
                   },
               .stopped =
                   [this](const std::string& why) {
                     part_.reset();
                     say(Condition::NotReady, why);
                   }}) {}

void Link::say(Condition condition, const std::string& text) {
  if (text != text_) log::info("{}", text);
  condition_ = condition;
  text_ = text;
  publisher_.say(condition, text, monotonic_ns());
}

void Link::note_organ(const std::filesystem::path& organ, const Vec3d& offset_m) {
  const Vec3d ras_mm = Vec3d{-offset_m.x, offset_m.z, offset_m.y} * 1e3;
  const auto text = fmt::format("{} is made; its centre is at R {:.2f} A {:.2f} S {:.2f} mm",
                                organ.string(), ras_mm.x, ras_mm.y, ras_mm.z);
  log::info("{}", text);
  peers_.publish("STATUS organ", status_message("Trocar_organ", Condition::Fine, text));
  if (!options_.studio.serves) {
    log::info(
        "a session of it: trocar-server --organ {}, and beside it: trocar-igtl "
        "--origin={:.2f},{:.2f},{:.2f}",
        organ.string(), ras_mm.x, ras_mm.y, ras_mm.z);
    return;
  }
  part_.reset();
  publisher_.begin_anew();
  tools_.begin_anew();
  frames_ = Frames(offset_m);
}

Status Link::join(std::uint16_t port) {
  net::NetSourceOptions connection;
  const auto server =
      port == 0 ? options_.server
                : fmt::format("{}:{}", options_.server.substr(0, options_.server.rfind(':')), port);
  if (const auto parsed = net::parse_server_address(server, connection); !parsed)
    return Error{parsed.error().code, "--server: " + parsed.error().message};
  if (const auto set = net::set_security(options_.way, connection); !set) return set;
  connection.connect_deadline =
      std::chrono::milliseconds(static_cast<std::int64_t>(options_.wait_s * 1e3));
  connection.participant_name = options_.name;
  connection.role = static_cast<int>(options_.way.role);
  connection.tools = tools_.shapes();
  part_ = std::make_unique<Part>(std::move(connection));
  return {};
}

Status Link::take_tool_message(const PeerMessage& message) {
  const auto& header = message.header;
  // Slicer may send transforms and texts that are meant for nobody here.
  if (!tools_.has(header.device)) return {};
  const auto content = content_of(header, message.body);
  if (!content) return content.error();
  const auto named = [&](const Status& status) {
    if (status) return status;
    return Status(Error{status.error().code, header.name() + ": " + status.error().message});
  };
  if (header.kind() == Kind::Text) {
    const auto text = read_text(header, *content);
    if (!text) return text.error();
    return named(tools_.use(header.device, message.peer, *text));
  }
  const auto transform = read_transform(header, *content);
  if (!transform) return transform.error();
  return named(tools_.move(header.device, message.peer, *transform, frames_));
}

void Link::hear(PeerMessage message) {
  const auto peer = message.peer;
  const bool is_of_tool =
      message.header.kind() == Kind::Place || message.header.kind() == Kind::Text;
  const auto taken = is_of_tool ? take_tool_message(message) : studio_.take(std::move(message));
  if (!taken) peers_.blame(peer, taken.error());
}

Status Link::begin() {
  if (!options_.studio.serves)
    if (const auto joined = join(0); !joined) return joined;
  if (const auto opened = peers_.open(options_.address, options_.port); !opened) return opened;
  log::info("OpenIGTLink at {}:{}, Ctrl-C ends it", options_.address, peers_.port());
  if (!secure::is_loopback(options_.address))
    log::warn(
        "OpenIGTLink knows neither codes nor encryption: who reaches {}:{} sees the session{}",
        options_.address, peers_.port(),
        options_.tools.empty() ? "" : ", and moves the instruments of --hold");
  if (!options_.ready_file.empty())
    if (const auto written =
            write_text_file(options_.ready_file, std::to_string(peers_.port()) + "\n");
        !written)
      return written;
  for (const int signal : ending_signals()) signals_.add(signal);
  signals_.async_wait([this](const boost::system::error_code& error, int) {
    if (!error) is_stopped_ = true;
  });
  if (options_.seconds > 0)
    end_ns_ = monotonic_ns() + static_cast<std::uint64_t>(std::llround(options_.seconds * 1e9));
  if (!options_.label_map.empty()) return studio_.take_file(options_.label_map);
  if (options_.studio.serves) say(Condition::NotReady, kWaiting);
  return {};
}

void Link::step() {
  context_.run_for(kPoll);
  const auto now_ns = monotonic_ns();
  studio_.poll();
  if (part_) {
    const bool was_there = part_->condition() == Condition::Fine;
    part_->poll();
    if (!was_there && part_->condition() == Condition::Fine)
      log::info("in the session at {}: {}", part_->source().name(), part_->text());
    if (part_->replica().newest() != nullptr) tools_.send_due(part_->source(), now_ns);
    publisher_.update(part_->replica(), frames_, now_ns);
    if (!studio_.is_busy()) {
      condition_ = part_->condition();
      text_ = part_->text();
    }
  }
  publisher_.say(condition_, text_, now_ns);
  is_stopped_ = is_stopped_ || (end_ns_ != 0 && now_ns >= end_ns_);
}

Result<ExitCode> Link::run() {
  if (const auto begun = begin(); !begun) return begun.error();
  while (!is_stopped_ && !failure_ && !(part_ && part_->is_over() && !options_.studio.serves))
    step();
  return end();
}

Result<ExitCode> Link::end() {
  const std::string why = part_ && part_->is_over() ? part_->why_over() : "the link ends";
  const auto kind =
      part_ && part_->is_over() ? part_->source().close_reason().kind : replica::CloseKind::Ended;
  const bool is_broken = part_ && !part_->replica().fault().ok();
  publisher_.say(Condition::Over, why, monotonic_ns());
  context_.run_for(kLastWords);
  peers_.close();
  context_.run_for(kPoll);
  part_.reset();
  studio_.end_session();
  if (failure_) return *failure_;
  if (is_broken) return Error{ErrorCode::BadMessage, why};
  if (const auto ending = net::ending_of({kind, why}); !ending) return ending.error();
  log::info("{}", why);
  return ExitCode::Ok;
}

}  // namespace

Result<ExitCode> run_link(const LinkOptions& options) {
  return Link(options).run();
}

}  // namespace trocar::slicer
