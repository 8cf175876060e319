#pragma once
// Edits of the engine on their way back to the wire.

#include "proto/update_log.h"
#include "server/scene_log.h"

namespace gridcast::server {

/// One line of the log. Moves of many instances become as many edits.
void write_line(const LogLine& line, proto::LogWriter& to);

}  // namespace gridcast::server
