// trocar-server: hosts one session.

#include "common/base/time_slice.h"
#include "server/app/config/service.h"
#include "server/app/server/check_start.h"
#include "server/app/server/options.h"
#include "server/app/server/server.h"

namespace trocar::app {
namespace {

Status run(const ServerOptions& options) {
  ask_for_short_slices();  // and for all threads that are started from here on
  return run_server(options);
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  using namespace trocar::app;
  return run_service<ServerOptions>({"trocar-server", parse_command_line, check_start, run}, argc,
                                    argv);
}
