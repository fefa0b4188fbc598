#include "common/impair/proxy.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <map>

#include "common/base/json.h"
#include "common/base/spawn.h"
#include "common/impair/datagram_relay.h"
#include "common/impair/stream_relay.h"
#include "common/intake/acceptor.h"

namespace trocar::impair {
namespace {

using asio::ip::tcp;
using asio::ip::udp;
// After a failed accept (no file descriptors left): wait instead of spinning.
constexpr std::chrono::milliseconds kAcceptRetry{100};
// Any free port must be free for both; the second is taken rarely.
constexpr int kPortTries = 20;

}  // namespace

class Proxy::Core : public std::enable_shared_from_this<Proxy::Core> {
 public:
  Core(asio::io_context& context, const ProxyOptions& options)
      : network(std::make_shared<Network>(options)), acceptor(context), retry(context) {}

  Status open() {
    if (const auto found = find_server(); !found) return found;
    const auto& options = network->options;
    if (auto checked = intake::check_address(options.listen_address, "--listen"); !checked)
      return checked;
    const auto address = asio::ip::make_address(options.listen_address);
    boost::system::error_code error;
    for (int i = 0; i < (options.listen_port == 0 ? kPortTries : 1); ++i) {
      error = bind(address);
      if (!error) return {};
    }
    return Error{ErrorCode::ResourceMissing,
                 "port " + std::to_string(options.listen_port) + " at " + options.listen_address +
                     " cannot be used for TCP and UDP (" + error.message() +
                     "): stop the program that has it or choose another with --listen"};
  }

  void start() {
    datagrams->start();
    spawn(acceptor.get_executor(), accept_streams(),
          [self = shared_from_this()](std::exception_ptr failure) { rethrow(failure); });
  }

  void stop() {
    is_stopped = true;
    boost::system::error_code ignored;
    acceptor.close(ignored);
    retry.cancel();
    datagrams->close();
    const auto all = std::move(streams);
    streams.clear();
    for (const auto& [number, stream] : all) stream->close();
  }

  const std::shared_ptr<Network> network;
  std::map<std::uint64_t, std::shared_ptr<StreamRelay>> streams;
  std::uint16_t port = 0;

 private:
  Status find_server() {
    const auto& options = network->options;
    boost::system::error_code error;
    tcp::resolver resolver(acceptor.get_executor());
    const auto found = resolver.resolve(options.server_host, std::to_string(options.server_port),
                                        tcp::resolver::numeric_service, error);
    if (error || found.empty())
      return Error{ErrorCode::ResourceMissing, "--to: no machine '" + options.server_host +
                                                   "' is known (" + error.message() +
                                                   "): write its address"};
    // Datagrams cannot tell which of several addresses answers, so "localhost" is 127.0.0.1.
    const auto is_v4 = [](const auto& entry) { return entry.endpoint().address().is_v4(); };
    const auto first_v4 = std::find_if(found.begin(), found.end(), is_v4);
    network->stream_server = (first_v4 == found.end() ? found.begin() : first_v4)->endpoint();
    network->datagram_server = {network->stream_server.address(), options.server_port};
    return {};
  }

  boost::system::error_code bind(const asio::ip::address& address) {
    boost::system::error_code error, ignored;
    acceptor.close(ignored);
    const tcp::endpoint endpoint(address, network->options.listen_port);
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
    // Accepted sockets inherit it.
    const int buffer = receive_buffer_bytes(network->options.up);
    if (!error) acceptor.set_option(asio::socket_base::receive_buffer_size(buffer), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error) return error;
    port = acceptor.local_endpoint(error).port();
    const udp::endpoint same(address, port);
    udp::socket socket(acceptor.get_executor());
    socket.open(same.protocol(), error);
    if (!error) socket.bind(same, error);
    if (!error) datagrams = std::make_shared<DatagramRelay>(network, std::move(socket));
    return error;
  }

  void admit(tcp::socket socket) {
    if (streams.size() >= network->options.most_streams) {
      ++network->streams_refused;
      return;
    }
    const std::uint64_t number = network->streams++;
    auto stream = std::make_shared<StreamRelay>(network, std::move(socket), number);
    streams.emplace(number, stream);
    stream->start([self = shared_from_this(), number] { self->streams.erase(number); });
  }

  asio::awaitable<void> accept_streams() {
    while (!is_stopped) {
      auto [error, socket] = co_await acceptor.async_accept(kNoThrow);
      if (is_stopped) break;
      if (error) {
        retry.expires_after(kAcceptRetry);
        co_await retry.async_wait(kNoThrow);
        continue;
      }
      admit(std::move(socket));
    }
  }

  tcp::acceptor acceptor;
  asio::steady_timer retry;
  std::shared_ptr<DatagramRelay> datagrams;
  bool is_stopped = false;
};

Result<std::unique_ptr<Proxy>> Proxy::listen(asio::io_context& context,
                                             const ProxyOptions& options) {
  auto core = std::make_shared<Core>(context, options);
  if (const auto opened = core->open(); !opened) return opened.error();
  return std::unique_ptr<Proxy>(new Proxy(std::move(core)));
}

Proxy::Proxy(std::shared_ptr<Core> core) : core_(std::move(core)) {}
Proxy::~Proxy() {
  core_->stop();
}

void Proxy::start() {
  core_->start();
}
void Proxy::stop() {
  core_->stop();
}
std::uint16_t Proxy::port() const {
  return core_->port;
}
const Network& Proxy::network() const {
  return *core_->network;
}
std::size_t Proxy::stream_count() const {
  return core_->streams.size();
}
std::size_t Proxy::stream_waiting_bytes() const {
  std::size_t bytes = 0;
  for (const auto& [number, stream] : core_->streams) bytes += stream->waiting_bytes();
  return bytes;
}

namespace {

Json json_of(const Amount& amount) {
  return {{"packets", amount.packets}, {"bytes", amount.bytes}};
}

Json json_of(const Totals& totals, bool is_stream) {
  Json json{{"passed", json_of(totals.passed)}, {"lost", json_of(totals.lost)}};
  if (!is_stream) {
    json["blocked"] = json_of(totals.blocked);
    json["duplicated"] = json_of(totals.duplicated);
    json["reordered"] = json_of(totals.reordered);
    json["dropped_by_queue"] = json_of(totals.dropped);
  }
  json["delay_ms"] = {{"mean", totals.delays.mean_ms()},
                      {"median", totals.delays.share_ms(0.5)},
                      {"p99", totals.delays.share_ms(0.99)}};
  return json;
}

}  // namespace

std::string to_json(const Network& network) {
  const Json json{{"seconds", std::chrono::duration<double>(network.now()).count()},
                  {"seed", network.options.seed},
                  {"stream",
                   {{"opened", network.streams},
                    {"refused", network.streams_refused},
                    {"up", json_of(network.up.stream, true)},
                    {"down", json_of(network.down.stream, true)}}},
                  {"datagrams",
                   {{"peers", network.peers},
                    {"refused", network.datagrams_refused},
                    {"up", json_of(network.up.datagrams, false)},
                    {"down", json_of(network.down.datagrams, false)}}}};
  return to_text(json);
}

}  // namespace trocar::impair
