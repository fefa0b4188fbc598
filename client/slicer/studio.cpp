#include "client/slicer/studio.h"

#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <fstream>
#include <sstream>
#include <utility>

#include "client/slicer/scan_files.h"
#include "common/base/json.h"
#include "common/base/log.h"

namespace trocar::slicer {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostSaid = 64 * 1024;
constexpr auto kGrace = std::chrono::seconds(15);  // until its recording is whole
constexpr int kMostNumbers = 100'000;

std::string file_name_of(const std::string& device) {
  std::string name;
  for (const char c : device) {
    const bool is_plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                          (c >= 'a' && c <= 'z') || c == '-' || c == '_';
    name += is_plain ? c : '_';
  }
  return name.empty() ? "organ" : name;
}

// Reads and writes one thing; on a thread of its own.
Result<fs::path> keep(const PeerMessage& message, fs::path path) {
  const auto content = content_of(message.header, message.body);
  if (!content) return content.error();
  Status written;
  if (message.header.kind() == Kind::LabelMap) {
    const auto image = read_label_image(message.header, *content);
    if (!image) return image.error();
    written = write_label_map(path += ".nii", *image);
  } else {
    const auto surface = read_surface(message.header, *content);
    if (!surface) return surface.error();
    written = write_surface(path += ".obj", *surface);
  }
  if (!written) return written.error();
  return path;
}

// Returns the last line that a program has said, without its name.
std::string last_line(const std::string& text) {
  const auto end = text.find_last_not_of('\n');
  if (end == std::string::npos) return "it has ended without a word";
  const auto before = text.rfind('\n', end);
  const auto begin = before == std::string::npos ? 0 : before + 1;
  auto line = text.substr(begin, end + 1 - begin);
  for (const char* program : {"trocar-organ: ", "trocar-server: "})
    if (line.starts_with(program)) line.erase(0, std::string(program).size());
  return line;
}

}  // namespace

Studio::Studio(StudioOptions options, StudioEvents events)
    : options_(std::move(options)),
      events_(std::move(events)),
      ready_file_(options_.folder / fmt::format(".trocar-igtl-{}.port", ::getpid())) {}

Studio::~Studio() {
  reading_.wait();
  end_session();
}

fs::path Studio::free_stem(const std::string& device) const {
  const auto name = file_name_of(device);
  for (int i = 1; i < kMostNumbers; ++i) {
    const auto stem = options_.folder / fmt::format("{}-{}", name, i);
    bool is_free = true;
    for (const char* ending : {".nii", ".obj", ".organ", ".server.log"}) {
      std::error_code ignored;
      auto path = stem;
      is_free = is_free && !fs::exists(path += ending, ignored);
    }
    if (is_free) return stem;
  }
  return options_.folder / name;
}

Status Studio::take(PeerMessage message) {
  if (options_.folder.empty())
    return Error{ErrorCode::Refused, message.header.name() +
                                         ": nothing is taken: start trocar-igtl with --serve, or "
                                         "with --folder"};
  if (is_busy())
    return Error{ErrorCode::Refused,
                 message.header.name() + ": an organ is being made, send it again"};
  if (++taken_ > kMostTaken)
    return Error{ErrorCode::Refused, fmt::format("{}: {} were taken, so none is any more: start "
                                                 "trocar-igtl again",
                                                 message.header.name(), kMostTaken)};
  for_peer_ = message.peer;
  reads_surface_ = message.header.kind() == Kind::Surface;
  stage_ = Stage::Reading;
  events_.said("reading " + message.header.name());
  const auto stem = free_stem(message.header.device);
  reading_.start([this, stem, message = std::move(message)] { read_ = keep(message, stem); });
  return {};
}

Status Studio::take_file(const fs::path& label_map) {
  label_map_ = label_map;
  for_peer_ = 0;
  return begin_import();
}

void Studio::fail(const Error& error) {
  stage_ = Stage::Idle;
  child_.reset();
  events_.failed(for_peer_, error);
}

Status Studio::start(std::vector<std::string> words) {
  // A session may run on the same machine.
  words.insert(words.begin(), {"nice", "-n", "10", "setpriv", "--pdeathsig", "TERM", "--",
                               process::find_program("trocar-organ")});
  said_.emplace();
  complained_.emplace();
  auto child = process::Child::start(
      {.words = std::move(words), .out = said_->descriptor(), .errors = complained_->descriptor()});
  if (!child) return child.error();
  child_.emplace(std::move(*child));
  return {};
}

Status Studio::begin_import() {
  std::error_code ignored;
  organ_ = options_.folder / label_map_.stem().replace_extension(".organ");
  if (fs::exists(organ_, ignored)) (organ_ = free_stem(label_map_.stem().string())) += ".organ";
  std::vector<std::string> words{"import",  label_map_.string(),           "--out", organ_.string(),
                                 "--nodes", std::to_string(options_.nodes)};
  if (!options_.labels.empty()) words.insert(words.end(), {"--labels", options_.labels});
  if (!surface_.empty())
    words.insert(words.end(),
                 {"--embed", surface_.string(), "--embed-frame", "ras", "--embed-unit", "mm"});
  if (auto started = start(std::move(words)); !started) return started;
  stage_ = Stage::Importing;
  events_.said("making an organ of " + label_map_.filename().string());
  return {};
}

void Studio::finish_reading() {
  reading_.wait();
  if (!read_) return fail(read_.error());
  log::info("{} is written", read_->string());
  stage_ = Stage::Idle;
  if (reads_surface_) {
    surface_ = *read_;
    waits_ = true;
  } else {
    label_map_ = *read_;
    if (!waits_) surface_.clear();  // it was of the label map before
  }
  if (label_map_.empty()) return events_.said("the fine surface waits for its label map");
  if (const auto begun = begin_import(); !begun) fail(begun.error());
}

void Studio::finish_import() {
  const auto ending = child_->poll();
  if (!ending) return;
  const auto complaints = complained_->text(kMostSaid);
  if (ending->exit_code != 0) {
    surface_.clear();  // it may be what does not fit
    waits_ = false;
    return fail({ErrorCode::BadFile, last_line(complaints)});
  }
  std::istringstream lines(complaints);
  for (std::string line; std::getline(lines, line);) log::info("{}", last_line(line));
  waits_ = false;
  if (const auto begun = begin_inspection(); !begun) fail(begun.error());
}

Status Studio::begin_inspection() {
  stage_ = Stage::Inspecting;
  return start({"inspect", organ_.string(), "--json"});
}

void Studio::finish_inspection() {
  const auto ending = child_->poll();
  if (!ending) return;
  const auto json = Json::parse(said_->text(kMostSaid), nullptr, false);
  const auto offset = json.is_object() ? json.find("source_offset_m") : json.end();
  const bool is_known = ending->exit_code == 0 && offset != json.end() && offset->is_array() &&
                        offset->size() == 3 && offset->front().is_number();
  if (!is_known) return fail({ErrorCode::BadFile, last_line(complained_->text(kMostSaid))});
  const Vec3d offset_m{(*offset)[0].get<double>(), (*offset)[1].get<double>(),
                       (*offset)[2].get<double>()};
  child_.reset();
  stage_ = Stage::Idle;
  end_session();
  events_.made(organ_, offset_m);
  if (!options_.serves) return;
  if (const auto begun = begin_session(); !begun) fail(begun.error());
}

Status Studio::begin_session() {
  std::error_code ignored;
  fs::remove(ready_file_, ignored);
  std::vector<std::string> words{"setpriv",
                                 "--pdeathsig",
                                 "TERM",
                                 "--",
                                 process::find_program("trocar-server"),
                                 "--organ",
                                 organ_.string(),
                                 "--listen",
                                 options_.listen,
                                 "--ready-file",
                                 ready_file_.string()};
  if (options_.is_insecure) words.push_back("--insecure-loopback");
  if (!options_.records) words.insert(words.end(), {"--journal", "none"});
  auto log_file = organ_;
  log_file.replace_extension(".server.log");
  auto server = process::Child::start({.words = std::move(words), .log = log_file});
  if (!server) return server.error();
  server_.emplace(std::move(*server));
  stage_ = Stage::Starting;
  events_.said("starting a session with " + organ_.filename().string());
  return {};
}

void Studio::look_for_port() {
  std::ifstream file(ready_file_);
  std::string text;
  std::uint16_t port = 0;
  if (!std::getline(file, text)) return;
  std::from_chars(text.data(), text.data() + text.size(), port);
  std::error_code ignored;
  fs::remove(ready_file_, ignored);
  stage_ = Stage::Idle;
  events_.serving(port);
}

void Studio::watch_server() {
  if (!server_ || !server_->poll()) return;
  server_.reset();
  stage_ = Stage::Idle;
  auto log_file = organ_;
  std::ifstream file(log_file.replace_extension(".server.log"));
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  events_.stopped("the session has ended: " + last_line(text));
}

void Studio::poll() {
  if (stage_ == Stage::Reading && !reading_.is_busy()) finish_reading();
  if (stage_ == Stage::Importing) finish_import();
  if (stage_ == Stage::Inspecting) finish_inspection();
  if (stage_ == Stage::Starting) look_for_port();
  watch_server();
}

void Studio::end_session() {
  if (!server_) return;
  server_->stop(kGrace);
  server_.reset();
}

}  // namespace trocar::slicer
