#include "server/hall/bus/bus.h"

#include <algorithm>

#ifdef TROCAR_HAS_NATS
#include <nats/nats.h>

#include "common/secure/private_files.h"
#endif

namespace trocar::hall {

std::string without_passwords(const std::string& url) {
  std::string masked;
  for (std::size_t begin = 0; begin <= url.size();) {
    const auto comma = std::min(url.find(',', begin), url.size());
    std::string part = url.substr(begin, comma - begin);
    if (const auto at = part.rfind('@'); at != std::string::npos) {
      const auto scheme = part.find("://");
      const auto from = scheme != std::string::npos && scheme < at ? scheme + 3 : 0;
      part.replace(from, at - from, "***");
    }
    masked += (begin > 0 ? "," : "") + part;
    begin = comma + 1;
  }
  return masked;
}

#ifdef TROCAR_HAS_NATS

namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr int kReconnectWaitMs = 250, kConnectTimeoutMs = 2000, kEndTimeoutMs = 2000;

Error error_of(natsStatus status, const std::string& what) {
  const bool is_usage = status == NATS_INVALID_ARG || status == NATS_ADDRESS_MISSING;
  return {is_usage ? ErrorCode::Usage : ErrorCode::ResourceMissing,
          "--nats: " + what + " (" + natsStatus_GetText(status) + ")"};
}

std::string text_of(natsMsg* message) {
  const auto size = static_cast<std::size_t>(natsMsg_GetDataLength(message));
  return size > 0 && size <= Bus::kMostTextBytes ? std::string(natsMsg_GetData(message), size)
                                                 : std::string();
}

bool wants_tls(const std::string& url) {
  return url.starts_with("tls://");
}

// Each address has the scheme of the first: one that is read otherwise would be reached without
// TLS.
Status check_place(const BusPlace& place) {
  const auto& url = place.url;
  if (url.find('@') != std::string::npos)
    return Error{ErrorCode::Usage,
                 "--nats: " + without_passwords(url) +
                     " names a user, whose password all users of this machine could read: use "
                     "--nats-creds FILE"};
  for (std::size_t begin = 0; begin <= url.size();) {
    const auto comma = std::min(url.find(',', begin), url.size());
    const auto address = url.substr(begin, comma - begin);
    const auto scheme = address.find("://");
    const bool is_known = address.starts_with("nats://") || wants_tls(address) ||
                          (scheme == std::string::npos && address.find(' ') == std::string::npos);
    if (!is_known)
      return Error{ErrorCode::Usage,
                   "--nats: '" + address + "' is neither nats://HOST:PORT nor tls://HOST:PORT"};
    if (wants_tls(address) != wants_tls(url))
      return Error{ErrorCode::Usage,
                   "--nats: '" + url + "' has addresses with tls:// and others without"};
    begin = comma + 1;
  }
  if (!place.ca_file.empty() && !wants_tls(place.url))
    return Error{ErrorCode::Usage, "--nats-ca: needs --nats tls://HOST:PORT"};
  return {};
}

Status use_ca(natsOptions* options, const std::string& file) {
  const auto text = secure::read_small_file(file);
  if (!text) return Error{text.error().code, "--nats-ca: " + text.error().message};
  if (natsOptions_SetCATrustedCertificates(options, text->c_str()) == NATS_OK) return {};
  return Error{ErrorCode::BadFile, "--nats-ca: " + file + ": holds no certificate in PEM"};
}

Status use_creds(natsOptions* options, const std::string& file) {
  auto text = secure::read_private_file(file);
  if (!text) return Error{text.error().code, "--nats-creds: " + text.error().message};
  if (text->find("-----BEGIN NATS USER JWT-----") != std::string::npos) {
    if (natsOptions_SetUserCredentialsFromFiles(options, file.c_str(), nullptr) == NATS_OK)
      return {};
  } else {
    while (text->ends_with('\n') || text->ends_with('\r')) text->pop_back();
    const auto colon = text->find(':');
    const bool is_pair = colon != std::string::npos && colon > 0 &&
                         std::ranges::all_of(*text, [](char c) { return c > ' ' && c <= '~'; });
    if (is_pair && natsOptions_SetUserInfo(options, text->substr(0, colon).c_str(),
                                           text->substr(colon + 1).c_str()) == NATS_OK)
      return {};
  }
  return Error{ErrorCode::BadFile, "--nats-creds: " + file +
                                       ": holds neither one line USER:PASSWORD without spaces nor "
                                       "credentials of NATS"};
}

// Returns the error of a NATS that is there, and that waiting does not change.
Status check_refusal(natsStatus status, const BusPlace& place) {
  const auto refused = [&](const std::string& why) {
    return Error{ErrorCode::Refused, "--nats: " + place.url + " " + why};
  };
  switch (status) {
    case NATS_SSL_ERROR: {
      const char* detail = nats_GetLastError(nullptr);
      return refused(
          std::string("has no certificate that ") +
          (place.ca_file.empty() ? "this machine trusts" : place.ca_file + " vouches for") +
          " under that name (" + (detail != nullptr ? detail : "TLS") + ")");
    }
    case NATS_SECURE_CONNECTION_WANTED:
      return refused("speaks no TLS: nothing was sent");
    case NATS_CONNECTION_AUTH_FAILED:
      return refused(place.creds_file.empty() ? "wants a user: use --nats-creds FILE"
                                              : "does not let in who is in " + place.creds_file);
    default:
      return {};
  }
}

struct OptionsDeleter {
  void operator()(natsOptions* options) const { natsOptions_Destroy(options); }
};
// With such a call, the library connects while others go on.
void note_connection(natsConnection*, void*) {}

void hand_on(natsConnection*, natsSubscription*, natsMsg* message, void* closure) {
  const auto& take = *static_cast<const Bus::Take*>(closure);
  const char* reply = natsMsg_GetReply(message);
  const auto text = text_of(message);
  const std::string answer_to = reply != nullptr ? reply : "";
  natsMsg_Destroy(message);
  take(text, answer_to);
}

}  // namespace

struct Bus::Parts {
  natsConnection* connection = nullptr;
  std::vector<std::unique_ptr<Take>> takes;
  std::vector<natsSubscription*> subscriptions;
};

Bus::Bus(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

// Nothing that was subscribed is called any more once all threads of the library have ended.
Bus::~Bus() {
  for (auto* subscription : parts_->subscriptions) natsSubscription_Destroy(subscription);
  natsConnection_Destroy(parts_->connection);
  nats_CloseAndWait(kEndTimeoutMs);
  // At the end of the process a closed library frees what OpenSSL frees once more (libnats 3.4.1,
  // with TLS). An open one leaves it alone.
  nats_Open(-1);
}

Result<std::unique_ptr<Bus>> Bus::connect(const BusPlace& place, const std::string& name,
                                          bool is_patient) {
  if (const auto sound = check_place(place); !sound) return sound.error();
  const auto& url = place.url;
  natsOptions* made = nullptr;
  auto status = natsOptions_Create(&made);
  const std::unique_ptr<natsOptions, OptionsDeleter> options(made);
  if (status == NATS_OK) status = natsOptions_SetURL(made, url.c_str());
  if (status == NATS_OK) status = natsOptions_SetName(made, name.c_str());
  if (status == NATS_OK) status = natsOptions_SetTimeout(made, kConnectTimeoutMs);
  if (status == NATS_OK) status = natsOptions_SetMaxReconnect(made, -1);
  if (status == NATS_OK) status = natsOptions_SetReconnectWait(made, kReconnectWaitMs);
  if (status == NATS_OK && wants_tls(url)) status = natsOptions_SetSecure(made, true);
  if (status != NATS_OK)
    return Error{ErrorCode::Usage,
                 "--nats: '" + url + "' is not a URL of NATS, such as nats://127.0.0.1:4222"};
  if (!place.ca_file.empty())
    if (const auto used = use_ca(made, place.ca_file); !used) return used.error();
  if (!place.creds_file.empty())
    if (const auto used = use_creds(made, place.creds_file); !used) return used.error();
  auto parts = std::make_unique<Parts>();
  status = natsConnection_Connect(&parts->connection, made);
  if (const auto let_in = check_refusal(status, place); !let_in) return let_in.error();
  if (status != NATS_OK && is_patient) {
    status = natsOptions_SetRetryOnFailedConnect(made, true, note_connection, nullptr);
    if (status == NATS_OK) status = natsConnection_Connect(&parts->connection, made);
    if (status == NATS_NOT_YET_CONNECTED) status = NATS_OK;
  }
  if (status != NATS_OK) return error_of(status, "no NATS answers at " + url);
  return std::unique_ptr<Bus>(new Bus(std::move(parts)));
}

Status Bus::subscribe(const std::string& subject, Take take) {
  parts_->takes.push_back(std::make_unique<Take>(std::move(take)));
  natsSubscription* made = nullptr;
  const auto status = natsConnection_Subscribe(&made, parts_->connection, subject.c_str(), hand_on,
                                               parts_->takes.back().get());
  if (status != NATS_OK) return error_of(status, subject + " cannot be heard");
  parts_->subscriptions.push_back(made);
  return {};
}

bool Bus::publish(const std::string& subject, const std::string& text) {
  return text.size() <= kMostTextBytes &&
         natsConnection_Status(parts_->connection) == NATS_CONN_STATUS_CONNECTED &&
         natsConnection_PublishString(parts_->connection, subject.c_str(), text.c_str()) == NATS_OK;
}

std::vector<std::string> Bus::ask_all(const std::string& subject, const std::string& text,
                                      milliseconds wait) {
  std::vector<std::string> answers;
  natsInbox* inbox = nullptr;
  if (natsInbox_Create(&inbox) != NATS_OK) return answers;
  natsSubscription* made = nullptr;
  auto status = natsConnection_SubscribeSync(&made, parts_->connection, inbox);
  if (status == NATS_OK)
    status = natsConnection_PublishRequestString(parts_->connection, subject.c_str(), inbox,
                                                 text.c_str());
  const auto end = Clock::now() + wait;
  while (status == NATS_OK && Clock::now() < end) {
    const auto left = std::chrono::ceil<milliseconds>(end - Clock::now());
    natsMsg* message = nullptr;
    status = natsSubscription_NextMsg(&message, made, left.count());
    if (status != NATS_OK) break;
    if (auto answer = text_of(message); !answer.empty()) answers.push_back(std::move(answer));
    natsMsg_Destroy(message);
  }
  natsSubscription_Destroy(made);
  natsInbox_Destroy(inbox);
  return answers;
}

Result<std::string> Bus::ask(const std::string& subject, const std::string& text,
                             milliseconds deadline) {
  natsMsg* message = nullptr;
  const auto status = natsConnection_RequestString(&message, parts_->connection, subject.c_str(),
                                                   text.c_str(), deadline.count());
  if (status != NATS_OK) return error_of(status, "no hall answers");
  auto answer = text_of(message);
  natsMsg_Destroy(message);
  return answer;
}

#else

struct Bus::Parts {};

Bus::Bus(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Bus::~Bus() = default;

Result<std::unique_ptr<Bus>> Bus::connect(const BusPlace&, const std::string&, bool) {
  return Error{ErrorCode::Usage,
               "--nats: these programs were built without NATS: install libnats-dev, and build "
               "them again"};
}
Status Bus::subscribe(const std::string&, Take) {
  return {};
}
bool Bus::publish(const std::string&, const std::string&) {
  return false;
}
std::vector<std::string> Bus::ask_all(const std::string&, const std::string&,
                                      std::chrono::milliseconds) {
  return {};
}
Result<std::string> Bus::ask(const std::string&, const std::string&, std::chrono::milliseconds) {
  return Error{ErrorCode::ResourceMissing, "no hall answers"};
}

#endif

}  // namespace trocar::hall
