#include "tests/network/tls_fixture.h"

#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "server/session/replication/messages.h"

namespace trocar::testing {

PrivateFolder::PrivateFolder() {
  static std::atomic<int> count{0};
  path_ = std::filesystem::temp_directory_path() /
          ("trocar-private-" + std::to_string(::getpid()) + "-" + std::to_string(count++));
  std::filesystem::remove_all(path_);
  ::mkdir(path_.c_str(), 0700);
}

PrivateFolder::~PrivateFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

const secure::Identity& identity(int number) {
  static const std::array<secure::Identity, 2> identities{*secure::make_identity(),
                                                          *secure::make_identity()};
  return identities[static_cast<std::size_t>(number)];
}

secure::HalfCode certificate_code(int number) {
  return secure::code_of_certificate(
      *secure::certificate_der(identity(number).certificate_pem, "test"));
}

net::TcpServerOptions tls_options(int number) {
  net::TcpServerOptions options;
  options.tls = *secure::make_server_context(identity(number), "test");
  options.plain_reply =
      replication::encode_goodbye(replication::EndReason::Version, "this server speaks TLS");
  return options;
}

GuardedSession::GuardedSession(std::int64_t uses, net::TcpServerOptions tcp,
                               replication::ReplicatorOptions options) {
  auto book = *access::CodeBook::open(folder.path(), kBookPort, false, unix_seconds);
  for (const auto& known : wire::kRoles)
    secrets_[known.role] = *book.issue(known.role, unix_seconds + kLifetime, uses);
  auto audit = access::AuditLog::open(folder.path() / "audit.jsonl");
  gate_ =
      std::make_unique<access::Gate>(std::move(book), std::move(*audit),
                                     access::GateOptions{[this] { return clock_ns.load(); },
                                                         [this] { return unix_seconds.load(); }});
  options.gate = gate_.get();
  session = std::make_unique<LiveSession>(std::move(tcp), std::move(options));
}

secure::JoinCode GuardedSession::code(wire::Role role) const {
  return {certificate_code(), secrets_.at(role)};
}

access::GateCounters GuardedSession::counters() {
  return session->on_io([this] { return gate_->counters(); });
}

std::vector<std::string> GuardedSession::audit() const {
  std::vector<std::string> lines;
  std::ifstream in(folder.path() / "audit.jsonl");
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

}  // namespace trocar::testing
