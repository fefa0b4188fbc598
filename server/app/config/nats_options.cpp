#include "server/app/config/nats_options.h"

namespace trocar::app {

void add_nats_options(CLI::App& app, bus::BusPlace& place, const char* meaning) {
  auto* url = app.add_option("--nats", place.url, meaning)->type_name("URL");
  app.add_option("--nats-ca", place.ca_file,
                 "who vouches for the certificate of tls://HOST:PORT (PEM), besides those whom "
                 "this machine trusts")
      ->needs(url)
      ->type_name("FILE");
  app.add_option("--nats-creds", place.creds_file,
                 "get in with this file: a line USER:PASSWORD, or NATS's own credentials [no]")
      ->needs(url)
      ->type_name("FILE");
}

}  // namespace trocar::app
