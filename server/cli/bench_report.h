#pragma once

#include <string>

#include "core/measure/report.h"

namespace gridcast::server {

/// Prints the rows of `report` that `printed` does not have yet, as tables on stdout, and brings it up to
/// date.
void print_new_rows(const measure::Report& report, measure::Report& printed);

}  // namespace gridcast::server
