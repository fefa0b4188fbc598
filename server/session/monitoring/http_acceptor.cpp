#include "server/session/monitoring/http_acceptor.h"

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <exception>
#include <utility>

#include "common/base/no_throw.h"
#include "common/base/spawn.h"

namespace trocar::monitoring {
namespace {

using tcp = asio::ip::tcp;

constexpr std::chrono::milliseconds kAcceptRetry{200};

}  // namespace

Status check_address(const std::string& address, const std::string& named) {
  boost::system::error_code error;
  asio::ip::make_address(address, error);
  if (!error) return {};
  return Error{ErrorCode::Usage, named + ": '" + address +
                                     "' is not an IPv4 or IPv6 address: use 127.0.0.1 for this "
                                     "machine only"};
}

Status HttpAcceptor::open(const std::string& address, std::uint16_t port,
                          const std::string& named) {
  if (auto checked = check_address(address, named); !checked) return checked;
  boost::system::error_code error;
  const tcp::endpoint endpoint(asio::ip::make_address(address, error), port);
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (!error) return {};
  return Error{ErrorCode::ResourceMissing, named + ": " + address + ":" + std::to_string(port) +
                                               ": " + error.message() + ", choose another port"};
}

HttpAcceptor::Newcomer::Newcomer(HttpAcceptor& acceptor, std::string address,
                                 std::function<void()> cut)
    : acceptor_(acceptor), id_(acceptor.next_id_++) {
  acceptor_.newcomers_.emplace(id_, Waiting{std::move(address), std::move(cut)});
}

bool HttpAcceptor::make_room() {
  std::map<std::string, std::size_t> counts;
  std::size_t most = 0;
  for (const auto& [id, one] : newcomers_) most = std::max(most, ++counts[one.address]);
  const auto oldest = std::ranges::find_if(
      newcomers_, [&](const auto& one) { return counts[one.second.address] == most; });
  if (oldest == newcomers_.end()) return false;
  const auto cut = std::move(oldest->second.cut);
  newcomers_.erase(oldest);
  cut();
  return true;
}

void HttpAcceptor::start(Serve serve, const std::shared_ptr<void>& owner) {
  spawn(context_.get_executor(), accept(std::move(serve), owner), rethrow);
}

asio::awaitable<void> HttpAcceptor::accept(Serve serve, std::shared_ptr<void> owner) {
  asio::steady_timer retry(context_);
  while (!is_stopping_) {
    auto [error, socket] = co_await acceptor_.async_accept(kNoThrow);
    if (is_stopping_) co_return;
    if (error) {
      retry.expires_after(kAcceptRetry);
      co_await retry.async_wait(kNoThrow);
      continue;
    }
    if (open_ >= most_connections_ && !make_room()) continue;  // closes it
    ++open_;
    spawn(context_.get_executor(), serve(std::move(socket)),
          [this, owner](const std::exception_ptr& failure) {
            --open_;
            rethrow(failure);
          });
  }
}

std::uint16_t HttpAcceptor::port() const {
  boost::system::error_code ignored;
  return acceptor_.local_endpoint(ignored).port();
}

void HttpAcceptor::stop() {
  is_stopping_ = true;
  boost::system::error_code ignored;
  acceptor_.close(ignored);
}

}  // namespace trocar::monitoring
