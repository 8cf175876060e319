#include <string_view>

#include "server/cli/cli.h"
#include "server/import/import_helper.h"
#include "server/import/import_order.h"

int main(int argc, char** argv) {
  if (argc == 2 && argv[1] == gridcast::server::kImportCommand) gridcast::server::run_import_helper();
  return gridcast::server::run_command_line(argc, argv);
}
