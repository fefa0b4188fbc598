// trocar-relay: passes a session on to many who watch.

#include "server/app/config/service.h"
#include "server/app/relay/relay_server.h"

int main(int argc, char** argv) {
  using namespace trocar::app;
  return run_service<RelayOptions>(
      {"trocar-relay", parse_relay_command_line, check_relay, run_relay}, argc, argv);
}
