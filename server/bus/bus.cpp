#include "server/bus/bus.h"

#include <algorithm>

#ifdef TROCAR_HAS_NATS
#include <nats/nats.h>

#include <condition_variable>
#include <mutex>
#include <shared_mutex>
#include <thread>

#include "common/base/backoff.h"
#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/secure/private_files.h"
#endif

namespace trocar::bus {

#ifdef TROCAR_HAS_NATS

namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr int kConnectTimeoutMs = 2000, kWriteTimeoutMs = 2000, kFlushTimeoutMs = 500,
              kEndTimeoutMs = 2000;
constexpr milliseconds kFirstPause{250}, kLongestPause{4000};

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

}  // namespace

struct Bus::Parts {
  struct OptionsDeleter {
    void operator()(natsOptions* made) const { natsOptions_Destroy(made); }
  };
  struct Heard {
    std::string subject;
    Take take;
    natsSubscription* subscription = nullptr;  // null: there is no connection
  };
  // Says something in the log, unless it was the last that was said.
  class Complaint {
   public:
    void say(const std::string& text) {
      const std::lock_guard guard(lock_);
      if (std::exchange(said_, text) != text) log::warn("{}", text);
    }
    // Returns whether something was said since.
    bool forget() {
      const std::lock_guard guard(lock_);
      return !std::exchange(said_, "").empty();
    }

   private:
    std::mutex lock_;
    std::string said_;
  };

  BusPlace place;
  std::unique_ptr<natsOptions, OptionsDeleter> options;
  mutable std::shared_mutex lock;        // of what stands here
  natsConnection* connection = nullptr;  // null: there is none
  std::vector<std::unique_ptr<Heard>> heard;

  std::mutex keeper_lock;  // likewise
  std::condition_variable_any has_changed;
  bool is_gone = false;  // the connection has ended, or there was none

  Complaint trouble, asynchronous;
  std::jthread keeper;  // of a patient connection

  // Fills `options` from `place`; an error is one of theirs.
  Status make_options(const std::string& name);
  Status open(natsConnection*& made) const;
  natsStatus hear(Heard& one) const;
  // Takes `made` for the connection from now on, and hears on it what was heard before.
  Status use(natsConnection* made);
  // Lets the connection go; false: there was none.
  bool drop();
  void keep(const std::stop_token& stop);
  static void hand_on(natsConnection*, natsSubscription*, natsMsg* message, void* closure);
  static void note_closed(natsConnection* closed, void* closure);
  static void note_error(natsConnection* connection, natsSubscription*, natsStatus status,
                         void* closure);
};

Status Bus::Parts::make_options(const std::string& name) {
  natsOptions* made = nullptr;
  auto status = natsOptions_Create(&made);
  options.reset(made);
  if (status == NATS_OK) status = natsOptions_SetURL(made, place.url.c_str());
  if (status == NATS_OK) status = natsOptions_SetName(made, name.c_str());
  if (status == NATS_OK) status = natsOptions_SetTimeout(made, kConnectTimeoutMs);
  if (status == NATS_OK) status = natsOptions_SetWriteDeadline(made, kWriteTimeoutMs);
  if (status == NATS_OK) status = natsOptions_SetAllowReconnect(made, false);
  if (status == NATS_OK) status = natsOptions_SetNoEcho(made, true);
  if (status == NATS_OK) status = natsOptions_SetClosedCB(made, note_closed, this);
  if (status == NATS_OK) status = natsOptions_SetErrorHandler(made, note_error, this);
  if (status == NATS_OK && place.wants_tls()) status = natsOptions_SetSecure(made, true);
  if (status != NATS_OK)
    return Error{ErrorCode::Usage,
                 "--nats: '" + place.url + "' is not a URL of NATS, such as nats://127.0.0.1:4222"};
  if (!place.ca_file.empty())
    if (auto used = use_ca(made, place.ca_file); !used) return used;
  return place.creds_file.empty() ? Status() : use_creds(made, place.creds_file);
}

Status Bus::Parts::open(natsConnection*& made) const {
  const auto status = natsConnection_Connect(&made, options.get());
  if (status == NATS_OK) return {};
  if (auto let_in = check_refusal(status, place); !let_in) return let_in;
  return error_of(status, "no NATS answers at " + place.url);
}

natsStatus Bus::Parts::hear(Heard& one) const {
  return natsConnection_Subscribe(&one.subscription, connection, one.subject.c_str(), hand_on,
                                  &one);
}

Status Bus::Parts::use(natsConnection* made) {
  const std::lock_guard guard(lock);
  connection = made;
  for (const auto& one : heard)
    if (const auto status = hear(*one); status != NATS_OK)
      return error_of(status, one->subject + " cannot be heard");
  return {};
}

bool Bus::Parts::drop() {
  std::vector<natsSubscription*> subscriptions;
  natsConnection* dropped = nullptr;
  {
    const std::lock_guard guard(lock);
    dropped = std::exchange(connection, nullptr);
    for (const auto& one : heard)
      subscriptions.push_back(std::exchange(one->subscription, nullptr));
  }
  for (auto* subscription : subscriptions) natsSubscription_Destroy(subscription);
  natsConnection_Destroy(dropped);
  return dropped != nullptr;
}

void Bus::Parts::hand_on(natsConnection*, natsSubscription*, natsMsg* message, void* closure) {
  const auto& take = static_cast<const Heard*>(closure)->take;
  const char* reply = natsMsg_GetReply(message);
  const auto text = text_of(message);
  const std::string answer_to = reply != nullptr ? reply : "";
  natsMsg_Destroy(message);
  take(text, answer_to);
}

void Bus::Parts::note_closed(natsConnection* closed, void* closure) {
  auto& parts = *static_cast<Parts*>(closure);
  {
    const std::shared_lock guard(parts.lock);
    if (closed != parts.connection) return;
  }
  const std::lock_guard guard(parts.keeper_lock);
  parts.is_gone = true;
  parts.has_changed.notify_all();
}

void Bus::Parts::note_error(natsConnection* connection, natsSubscription*, natsStatus status,
                            void* closure) {
  const char* detail = nullptr;
  if (status != NATS_SLOW_CONSUMER) natsConnection_GetLastError(connection, &detail);
  const std::string said = detail != nullptr ? detail : "";
  auto& parts = *static_cast<Parts*>(closure);
  parts.asynchronous.say("--nats: " + parts.place.url + " says: " +
                         printable(said.empty() ? natsStatus_GetText(status) : said, 200));
}

void Bus::Parts::keep(const std::stop_token& stop) {
  Backoff pause(kFirstPause, kLongestPause, 2);
  while (!stop.stop_requested()) {
    {
      std::unique_lock guard(keeper_lock);
      if (!has_changed.wait(guard, stop, [this] { return is_gone; })) return;
      is_gone = false;
    }
    if (drop()) log::info("NATS at {} has ended the connection", place.url);
    natsConnection* made = nullptr;
    auto opened = open(made);
    if (opened) opened = use(made);
    // One that has ended before it was in use has told nobody.
    if (opened && natsConnection_IsClosed(made))
      opened = Error{ErrorCode::ResourceMissing, "--nats: " + place.url + " hangs up at once"};
    if (opened) {
      if (trouble.forget()) log::info("NATS at {} is there", place.url);
      asynchronous.forget();
      pause.restart();
      continue;
    }
    trouble.say(opened.error().message + ": trying again");
    std::unique_lock guard(keeper_lock);
    is_gone = true;
    has_changed.wait_for(guard, stop, pause.next(), [] { return false; });
  }
}

Bus::Bus(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

// Nothing that was subscribed is called any more once all threads of the library have ended.
Bus::~Bus() {
  if (parts_->keeper.joinable()) {
    parts_->keeper.request_stop();
    parts_->keeper.join();
  }
  if (parts_->connection != nullptr)
    natsConnection_FlushTimeout(parts_->connection, kFlushTimeoutMs);
  parts_->drop();
  if (nats_CloseAndWait(kEndTimeoutMs) == NATS_TIMEOUT) {
    log::warn("NATS: a thread of the library does not end");
    (void)parts_.release();  // that thread may still use it
  }
  // At the end of the process a closed library frees what OpenSSL frees once more (libnats 3.4.1,
  // with TLS). An open one leaves it alone.
  nats_Open(-1);
}

Status Bus::check(const BusPlace& place) {
  if (auto sound = check_place(place); !sound) return sound;
  Parts parts;
  parts.place = place;
  return parts.make_options("check");
}

Result<std::unique_ptr<Bus>> Bus::connect(const BusPlace& place, const std::string& name,
                                          bool is_patient) {
  if (const auto sound = check_place(place); !sound) return sound.error();
  auto parts = std::make_unique<Parts>();
  parts->place = place;
  if (const auto made = parts->make_options(name); !made) return made.error();
  natsConnection* made = nullptr;
  auto opened = parts->open(made);
  if (opened) opened = parts->use(made);
  if (!opened && (!is_patient || opened.error().code != ErrorCode::ResourceMissing))
    return opened.error();
  if (!opened) parts->trouble.say(opened.error().message + ": trying again");
  if (is_patient) {
    {
      // One that has ended before it was in use has told nobody.
      const std::lock_guard guard(parts->keeper_lock);
      parts->is_gone |= !opened || natsConnection_IsClosed(made);
    }
    parts->keeper =
        std::jthread([kept = parts.get()](const std::stop_token& stop) { kept->keep(stop); });
  }
  return std::unique_ptr<Bus>(new Bus(std::move(parts)));
}

Status Bus::subscribe(const std::string& subject, Take take) {
  const std::lock_guard guard(parts_->lock);
  auto& heard = parts_->heard;
  heard.push_back(std::make_unique<Parts::Heard>(Parts::Heard{subject, std::move(take)}));
  if (parts_->connection == nullptr) return {};
  const auto status = parts_->hear(*heard.back());
  // A connection that has just ended comes back, and is heard then.
  if (status == NATS_OK || status == NATS_CONNECTION_CLOSED) return {};
  return error_of(status, subject + " cannot be heard");
}

bool Bus::publish(const std::string& subject, const std::string& text,
                  const std::string& answer_to) {
  const std::shared_lock guard(parts_->lock);
  auto* connection = parts_->connection;
  if (text.size() > kMostTextBytes || connection == nullptr) return false;
  const auto size = static_cast<int>(text.size());
  const auto status = answer_to.empty()
                          ? natsConnection_Publish(connection, subject.c_str(), text.data(), size)
                          : natsConnection_PublishRequest(connection, subject.c_str(),
                                                          answer_to.c_str(), text.data(), size);
  return status == NATS_OK;
}

std::vector<std::string> Bus::ask_all(const std::string& subject, const std::string& text,
                                      milliseconds wait, milliseconds first_wait) {
  const std::shared_lock guard(parts_->lock);
  std::vector<std::string> answers;
  natsInbox* inbox = nullptr;
  if (natsInbox_Create(&inbox) != NATS_OK) return answers;
  natsSubscription* made = nullptr;
  auto status = natsConnection_SubscribeSync(&made, parts_->connection, inbox);
  if (status == NATS_OK)
    status = natsConnection_PublishRequestString(parts_->connection, subject.c_str(), inbox,
                                                 text.c_str());
  auto end = Clock::now() + first_wait;
  while (status == NATS_OK && Clock::now() < end) {
    const auto left = std::chrono::ceil<milliseconds>(end - Clock::now());
    natsMsg* message = nullptr;
    status = natsSubscription_NextMsg(&message, made, left.count());
    if (status != NATS_OK) break;
    if (auto answer = text_of(message); !answer.empty()) {
      if (answers.empty()) end = Clock::now() + wait;
      answers.push_back(std::move(answer));
    }
    natsMsg_Destroy(message);
  }
  natsSubscription_Destroy(made);
  natsInbox_Destroy(inbox);
  return answers;
}

Result<std::string> Bus::ask(const std::string& subject, const std::string& text,
                             milliseconds deadline) {
  const std::shared_lock guard(parts_->lock);
  natsMsg* message = nullptr;
  const auto status = natsConnection_RequestString(&message, parts_->connection, subject.c_str(),
                                                   text.c_str(), deadline.count());
  if (status != NATS_OK) return error_of(status, "no hall answers");
  auto answer = text_of(message);
  natsMsg_Destroy(message);
  return answer;
}

std::size_t Bus::most_bytes() const {
  const std::shared_lock guard(parts_->lock);
  if (parts_->connection == nullptr) return 0;
  const auto bytes = natsConnection_GetMaxPayload(parts_->connection);
  return std::min(kMostTextBytes, static_cast<std::size_t>(std::max<std::int64_t>(0, bytes)));
}

#else

struct Bus::Parts {};

Bus::Bus(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Bus::~Bus() = default;

Status Bus::check(const BusPlace&) {
  return Error{ErrorCode::Usage,
               "--nats: these programs were built without NATS: install libnats-dev, and build "
               "them again"};
}
Result<std::unique_ptr<Bus>> Bus::connect(const BusPlace& place, const std::string&, bool) {
  return check(place).error();
}
Status Bus::subscribe(const std::string&, Take) {
  return {};
}
bool Bus::publish(const std::string&, const std::string&, const std::string&) {
  return false;
}
std::vector<std::string> Bus::ask_all(const std::string&, const std::string&,
                                      std::chrono::milliseconds, std::chrono::milliseconds) {
  return {};
}
Result<std::string> Bus::ask(const std::string&, const std::string&, std::chrono::milliseconds) {
  return Error{ErrorCode::ResourceMissing, "no hall answers"};
}
std::size_t Bus::most_bytes() const {
  return 0;
}

#endif

}  // namespace trocar::bus
