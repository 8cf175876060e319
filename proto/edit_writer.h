#pragma once
// Edits as POST .../transactions reads them: the inverse of parse_transaction.

#include "proto/reply_columns.h"
#include "proto/transaction.h"

namespace gridcast::proto {

/// Appends one edit, an object. Read back it is the same bit for bit: numbers have the shortest digits for
/// that. Members that have their default are left out.
void write_edit(JsonText& text, const TransactionEdit& edit);

}  // namespace gridcast::proto
