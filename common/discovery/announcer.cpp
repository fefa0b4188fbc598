#include "common/discovery/announcer.h"

#include <avahi-client/client.h>
#include <avahi-client/publish.h>
#include <avahi-common/alternative.h>
#include <avahi-common/error.h>
#include <avahi-common/malloc.h>
#include <avahi-common/thread-watch.h>

#include "common/base/log.h"
#include "common/discovery/avahi_text.h"

namespace trocar::discovery {

// Avahi's thread runs the callbacks with its lock held; others take the lock.
struct Announcer::Service {
  Service(const SessionNotice& what, std::uint16_t where)
      : notice(what), port(where), poll(avahi_threaded_poll_new()) {}

  void begin();
  void end();
  void set_people(int people);
  void publish();
  void explain(const char* why) const { log::info("the session is not announced: {}", why); }

  static void on_client(AvahiClient* client, AvahiClientState state, void* self);
  static void on_group(AvahiEntryGroup* group, AvahiEntryGroupState state, void* self);

  SessionNotice notice;
  const std::uint16_t port;
  AvahiThreadedPoll* poll;
  AvahiClient* client = nullptr;
  AvahiEntryGroup* group = nullptr;
};

void Announcer::Service::begin() {
  if (poll == nullptr) return explain("no memory");
  int error = 0;
  client = avahi_client_new(avahi_threaded_poll_get(poll), AVAHI_CLIENT_NO_FAIL, on_client, this,
                            &error);
  if (client == nullptr) return explain(avahi_strerror(error));
  avahi_threaded_poll_start(poll);
}

void Announcer::Service::end() {
  if (poll == nullptr) return;
  avahi_threaded_poll_stop(poll);
  if (client != nullptr) avahi_client_free(client);  // with its group
  avahi_threaded_poll_free(poll);
}

void Announcer::Service::set_people(int people) {
  if (client == nullptr) return;
  avahi_threaded_poll_lock(poll);
  if (people != notice.people) {
    notice.people = people;
    const auto text = to_list(to_txt(notice));
    if (group != nullptr && !avahi_entry_group_is_empty(group))
      avahi_entry_group_update_service_txt_strlst(group, AVAHI_IF_UNSPEC, AVAHI_PROTO_INET, {},
                                                  notice.name.c_str(), kServiceType, nullptr,
                                                  text.get());
  }
  avahi_threaded_poll_unlock(poll);
}

// Another session may have the name already: Avahi knows what to call this one then.
void Announcer::Service::publish() {
  if (group == nullptr) group = avahi_entry_group_new(client, on_group, this);
  if (group == nullptr) return explain(avahi_strerror(avahi_client_errno(client)));
  if (!avahi_entry_group_is_empty(group)) return;
  const auto text = to_list(to_txt(notice));
  int error = AVAHI_ERR_COLLISION;
  for (int tries = 0; tries < 20 && error == AVAHI_ERR_COLLISION; ++tries) {
    error = avahi_entry_group_add_service_strlst(group, AVAHI_IF_UNSPEC, AVAHI_PROTO_INET, {},
                                                 notice.name.c_str(), kServiceType, nullptr,
                                                 nullptr, port, text.get());
    if (error != AVAHI_ERR_COLLISION) break;
    char* const other = avahi_alternative_service_name(notice.name.c_str());
    notice.name = other;
    avahi_free(other);
  }
  if (error == 0) error = avahi_entry_group_commit(group);
  if (error != 0) explain(avahi_strerror(error));
}

void Announcer::Service::on_client(AvahiClient* client, AvahiClientState state, void* self) {
  auto& service = *static_cast<Service*>(self);
  // The first call comes before avahi_client_new has returned; later ones find it known, and others
  // may read it.
  if (service.client == nullptr) service.client = client;
  if (state == AVAHI_CLIENT_S_RUNNING) service.publish();
  if (state == AVAHI_CLIENT_CONNECTING) service.explain("no Avahi daemon runs here");
  if (state == AVAHI_CLIENT_FAILURE) service.explain(avahi_strerror(avahi_client_errno(client)));
  // The machine is being renamed: what is announced follows once that is done.
  if ((state == AVAHI_CLIENT_S_COLLISION || state == AVAHI_CLIENT_S_REGISTERING) &&
      service.group != nullptr)
    avahi_entry_group_reset(service.group);
}

void Announcer::Service::on_group(AvahiEntryGroup* group, AvahiEntryGroupState state, void* self) {
  auto& service = *static_cast<Service*>(self);
  service.group = group;
  if (state == AVAHI_ENTRY_GROUP_ESTABLISHED)
    log::info("announced on the local network as '{}'", service.notice.name);
  if (state == AVAHI_ENTRY_GROUP_FAILURE)
    service.explain(avahi_strerror(avahi_client_errno(service.client)));
  if (state != AVAHI_ENTRY_GROUP_COLLISION) return;
  char* const other = avahi_alternative_service_name(service.notice.name.c_str());
  service.notice.name = other;
  avahi_free(other);
  avahi_entry_group_reset(group);
  service.publish();
}

Announcer::Announcer(const SessionNotice& notice, std::uint16_t port)
    : service_(std::make_unique<Service>(notice, port)) {
  service_->notice.name = bounded_text(notice.name, kMostNameBytes);
  service_->begin();
}

Announcer::~Announcer() {
  service_->end();
}

void Announcer::set_people(int people) {
  service_->set_people(people);
}

}  // namespace trocar::discovery
