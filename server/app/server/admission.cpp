#include "server/app/server/admission.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "common/base/log.h"
#include "common/secure/certificate.h"
#include "common/secure/kept_identity.h"
#include "common/secure/loopback.h"
#include "common/secure/private_files.h"
#include "common/secure/public_host.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

Result<fs::path> state_folder(const AccessOptions& options) {
  if (!options.state_folder.empty()) return fs::absolute(options.state_folder);
  return secure::default_state_folder();
}

std::int64_t expiry(const AccessOptions& options) {
  return static_cast<std::int64_t>(std::time(nullptr)) + std::llround(options.code_hours * 3600);
}

std::int64_t uses(const AccessOptions& options) {
  return options.code_uses > 0 ? options.code_uses : -1;
}

std::string invitation_head(double hours) {
  return fmt::format(
      "Join codes, for {:g} hours (trocar-client --role ROLE --join CODE"
      " --server HOST:PORT, or --join LINK):\n",
      hours);
}

std::string invitation_line(const std::string& role, const secure::JoinCode& code,
                            const std::string& address, std::uint16_t port) {
  const auto server = secure::public_host(address) + ":" + std::to_string(port);
  return fmt::format("  {:<10}  {}  {}\n", role, secure::to_text(code),
                     secure::to_link(server, code));
}

Status check_loopback(const std::string& address) {
  if (secure::is_loopback(address)) return {};
  return Error{ErrorCode::Usage, "--insecure-loopback: " + address +
                                     " can be reached from other machines: use it with "
                                     "127.0.0.1 or [::1], or leave it out"};
}

// Says whether a private folder is there, or can be made.
Status check_state_folder(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder, ignored)) return secure::make_private_folder(folder);
  auto above = folder.parent_path();
  while (!above.empty() && !fs::exists(above, ignored)) above = above.parent_path();
  if (::access(above.c_str(), W_OK | X_OK) == 0) return {};
  return Error{ErrorCode::ResourceMissing, "--state: " + folder.string() + " cannot be made in " +
                                               above.string() + ": name another folder"};
}

}  // namespace

Status Admission::check(const AccessOptions& options, const std::string& address) {
  if (options.is_insecure) return check_loopback(address);
  const auto state = state_folder(options);
  if (!state) return state.error();
  if (const auto usable = check_state_folder(*state); !usable) return usable;
  Admission admission(options, address, false);
  admission.state_ = *state;
  const bool has_identity =
      !options.certificate_file.empty() ||
      (fs::exists(*state / "server.crt") && fs::exists(*state / "server.key"));
  return has_identity ? admission.read_identity() : Status();
}

Result<std::unique_ptr<Admission>> Admission::prepare(const AccessOptions& options,
                                                      const std::string& address,
                                                      bool is_resuming) {
  std::unique_ptr<Admission> admission(new Admission(options, address, is_resuming));
  if (options.is_insecure) {
    if (const auto safe = check_loopback(address); !safe) return safe.error();
    return admission;
  }
  auto state = state_folder(options);
  if (!state) return state.error();
  admission->state_ = std::move(*state);
  if (const auto made = secure::make_private_folder(admission->state_); !made) return made.error();
  if (const auto read = admission->read_identity(); !read) return read.error();
  return admission;
}

Status Admission::read_identity() {
  const auto kept =
      secure::read_or_make_identity(options_.certificate_file, options_.key_file, state_, "server");
  if (!kept) return kept.error();
  auto tls = secure::make_server_context(kept->identity, kept->source);
  if (!tls) return tls.error();
  const auto der = secure::certificate_der(kept->identity.certificate_pem, kept->source);
  if (!der) return der.error();
  tls_ = std::move(*tls);
  certificate_code_ = secure::code_of_certificate(*der);
  return {};
}

Status Admission::issue_codes(std::uint16_t port) {
  if (!tls_) return {};
  const auto now = static_cast<std::int64_t>(std::time(nullptr));
  auto book = access::CodeBook::open(state_, port, options_.keeps_codes || is_resuming_, now);
  if (!book) return book.error();
  places_file_ = places_file(state_, port);
  if (!is_resuming_) {
    std::error_code ignored;  // there is none, unless a server was killed
    fs::remove(places_file_, ignored);
  } else {
    auto places = read_places(places_file_);
    if (!places) return places.error();
    places_before_ = std::move(*places);
  }
  for (const auto& role : wire::kRoles) {
    const auto secret = book->issue(role.role, expiry(options_), uses(options_));
    if (!secret) return secret.error();
    codes_[role.name] = {certificate_code_, *secret};
  }
  auto audit = access::AuditLog::open(options_.audit_file.empty() ? state_ / "audit.jsonl"
                                                                  : fs::path(options_.audit_file));
  if (!audit) return audit.error();
  gate_ = std::make_unique<access::Gate>(std::move(*book), std::move(*audit));
  if (auto link = secure::write_link_file(port, codes_); link)
    link_file_ = std::move(*link);
  else
    log::warn("no code file, so clients on this machine need --join, too: {}",
              link.error().message);
  return {};
}

void Admission::keep_places(std::vector<KeptPlace> places) {
  if (places_file_.empty() || places == places_) return;
  places_ = std::move(places);
  if (const auto written = write_places(places_file_, places_); !written)
    log::warn("{}; nobody could come back to a resumed session", written.error().message);
}

Admission::~Admission() {
  std::error_code ignored;
  if (!places_file_.empty()) fs::remove(places_file_, ignored);
  if (!link_file_.empty()) fs::remove(link_file_, ignored);
  if (gate_ && !options_.keeps_codes) gate_->book().discard();
}

std::string Admission::invitation(std::uint16_t port) const {
  if (codes_.empty()) return {};
  std::string text = invitation_head(options_.code_hours);
  for (const auto& role : wire::kRoles)
    text += invitation_line(role.name, codes_.at(role.name), address_, port);
  return text;
}

Status change_codes(const AccessOptions& options, const std::string& address, std::uint16_t port) {
  const auto state = state_folder(options);
  if (!state) return state.error();
  auto book = access::CodeBook::open_running(*state, port);
  if (!book)
    return Error{book.error().code,
                 (options.revoke.empty() ? "--new-code: " : "--revoke: ") + book.error().message};
  if (!options.revoke.empty()) {
    const auto count = book->revoke(options.revoke, options.puts_out);
    if (!count) return count.error();
    std::printf("%zu %s revoked: nobody joins with %s any more; who is in %s\n", *count,
                *count == 1 ? "code is" : "codes are", *count == 1 ? "it" : "them",
                options.puts_out ? "has to go" : "stays (--put-out: has to go)");
  }
  if (options.new_code.empty()) return {};
  const auto admission = Admission::prepare(options, address);
  if (!admission) return admission.error();
  const auto role = std::ranges::find(wire::kRoles, options.new_code, &wire::NamedRole::name);
  const auto secret = book->issue(role->role, expiry(options), uses(options));
  if (!secret) return secret.error();
  const secure::JoinCode code{(*admission)->certificate_code(), *secret};
  std::printf("%s%s", invitation_head(options.code_hours).c_str(),
              invitation_line(role->name, code, address, port).c_str());
  return {};
}

}  // namespace trocar::app
