// How long a servo_cp takes from another maker's DDS through trocar-crtk to the server's socket:
// this program stands between trocar-crtk and a real server, passes on what they say, and looks at
// the tool samples on their way.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <optional>
#include <thread>
#include <vector>

#include "common/base/timing.h"
#include "common/process/process.h"
#include "proto/wire.pb.h"
#include "tests/crtk/messages.h"
#include "tests/e2e/programs.h"

namespace trocar::crtk {
namespace {

constexpr int kSamples = 2'000;
constexpr double kStep_m = 0.0002;

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

// Passes a connection on, and notes when a tool sample with another place has come.
class Between {
 public:
  explicit Between(int server_port) : listener_(::socket(AF_INET, SOCK_STREAM, 0)) {
    auto own = loopback(0);
    socklen_t size = sizeof(own);
    if (::bind(listener_, reinterpret_cast<sockaddr*>(&own), size) != 0 ||
        ::listen(listener_, 1) != 0 ||
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&own), &size) != 0)
      std::abort();
    port_ = ntohs(own.sin_port);
    thread_ = std::thread([this, server_port] { run(server_port); });
  }
  ~Between() { thread_.join(); }

  int port() const { return port_; }
  // When a place that was not seen before has come last; its number.
  std::uint64_t seen_ns() const { return seen_ns_; }
  int seen() const { return seen_; }

 private:
  void run(int server_port) {
    const int client = ::accept(listener_, nullptr, nullptr);
    const int server = ::socket(AF_INET, SOCK_STREAM, 0);
    const auto to = loopback(server_port);
    if (::connect(server, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) != 0) std::abort();
    std::vector<char> bytes(1 << 16);
    for (pollfd ends[2] = {{client, POLLIN, 0}, {server, POLLIN, 0}}; ::poll(ends, 2, -1) > 0;)
      for (int i = 0; i < 2; ++i) {
        if (ends[i].revents == 0) continue;
        const auto count = ::recv(ends[i].fd, bytes.data(), bytes.size(), 0);
        if (count <= 0) return finish(client, server);
        if (i == 0) look({bytes.data(), static_cast<std::size_t>(count)});
        const auto sent =
            ::send(ends[1 - i].fd, bytes.data(), static_cast<std::size_t>(count), MSG_NOSIGNAL);
        if (sent != count) return finish(client, server);
      }
  }
  static void finish(int client, int server) {
    ::close(client);
    ::close(server);
  }
  void look(std::string_view bytes) {
    const auto now_ns = monotonic_ns();
    waiting_.append(bytes);
    for (;;) {
      std::uint32_t length = 0;
      if (waiting_.size() < sizeof(length)) return;
      std::memcpy(&length, waiting_.data(), sizeof(length));
      if (waiting_.size() < sizeof(length) + length) return;
      proto::Envelope message;
      message.ParseFromArray(waiting_.data() + sizeof(length), static_cast<int>(length));
      waiting_.erase(0, sizeof(length) + length);
      if (!message.has_tool_sample()) continue;
      const float place = message.tool_sample().position_m().x();
      if (place == last_) continue;
      last_ = place;
      seen_ns_ = now_ns;
      ++seen_;
    }
  }

  const int listener_;
  int port_ = 0;
  std::thread thread_;
  std::string waiting_;
  float last_ = 0;
  std::atomic<std::uint64_t> seen_ns_{0};
  std::atomic<int> seen_{0};
};

int run() {
  const auto folder =
      std::filesystem::temp_directory_path() / ("trocar-bench-crtk-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  e2e::Program server("trocar-server",
                      {"--organ", "liver", "--journal", "none", "--insecure-loopback", "--listen",
                       "127.0.0.1:0", "--ready-file", (folder / "ready").string()},
                      folder / "server.log");
  if (!e2e::wait_for_file(folder / "ready", 60)) return 5;
  const auto address = e2e::ready_address(folder / "ready");
  auto between = std::make_unique<Between>(std::stoi(address.substr(address.rfind(':') + 1)));
  e2e::Program robot(
      "trocar-crtk",
      {"--server", "127.0.0.1:" + std::to_string(between->port()), "--insecure-loopback", "--arm",
       "PSM1", "--domain", std::to_string(domain_of_this_process())},
      folder / "crtk.log");
  FastPeer peer;
  peer.hear("rt/PSM1/operating_state", kStateType, true);
  peer.hear("rt/PSM1/measured_cp", kPoseType);
  const auto is_homed = [&] {
    const auto state = read_state(peer.newest("rt/PSM1/operating_state"));
    return state.is_homed && !state.is_busy;
  };
  const bool is_ready = e2e::wait_until(
      [&] {
        peer.say("rt/PSM1/state_command", kCommandType, write_command("home"));
        return e2e::wait_until(is_homed, 2) && !peer.newest("rt/PSM1/measured_cp").empty();
      },
      60);
  std::vector<double> ms;
  auto aim = read_pose(peer.newest("rt/PSM1/measured_cp"));
  for (int i = 0; is_ready && i < kSamples; ++i) {
    aim.position[0] += i % 100 < 50 ? kStep_m : -kStep_m;
    const int before = between->seen();
    const auto begin_ns = monotonic_ns();
    peer.say("rt/PSM1/servo_cp", kPoseType, write(aim));
    while (between->seen() == before && monotonic_ns() - begin_ns < 500'000'000)
      std::this_thread::sleep_for(std::chrono::microseconds(20));
    if (between->seen() != before && i >= 100)
      ms.push_back(static_cast<double>(between->seen_ns() - begin_ns) * 1e-6);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  robot.signal(SIGTERM);
  robot.wait(10);
  server.signal(SIGTERM);
  server.wait(10);
  between.reset();
  std::filesystem::remove_all(folder);
  if (ms.empty()) return 5;
  std::ranges::sort(ms);
  const auto share = [&](double part) {
    return ms[static_cast<std::size_t>(part * static_cast<double>(ms.size() - 1))];
  };
  fmt::print(
      "servo_cp to the server's socket, {} samples: median {:.3f} ms, 95 % {:.3f} ms, "
      "99 % {:.3f} ms, longest {:.3f} ms; {} lost\n",
      ms.size(), share(0.5), share(0.95), share(0.99), share(1),
      kSamples - 100 - static_cast<int>(ms.size()));
  return 0;
}

}  // namespace
}  // namespace trocar::crtk

int main() {
  return trocar::crtk::run();
}
