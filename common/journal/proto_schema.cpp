#include "common/journal/proto_schema.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <set>

#include "common/base/assert.h"

namespace trocar::journal {
namespace {

namespace pb = google::protobuf;

// Top-level types by full name; a nested type brings the whole of what it is nested in.
struct Reachable {
  std::set<std::string> types;
  std::set<const pb::FileDescriptor*> files;
};

template <typename TypeDescriptor>
std::string top_level_name(const TypeDescriptor& type) {
  const pb::Descriptor* parent = type.containing_type();
  return parent ? top_level_name(*parent) : std::string(type.full_name());
}

void visit(const pb::Descriptor& message, std::set<const pb::Descriptor*>& seen, Reachable& found) {
  if (!seen.insert(&message).second) return;
  found.types.insert(top_level_name(message));
  found.files.insert(message.file());
  if (message.containing_type()) visit(*message.containing_type(), seen, found);
  for (int i = 0; i < message.nested_type_count(); ++i) visit(*message.nested_type(i), seen, found);
  for (int i = 0; i < message.field_count(); ++i) {
    const pb::FieldDescriptor& field = *message.field(i);
    if (field.message_type()) visit(*field.message_type(), seen, found);
    if (!field.enum_type()) continue;
    found.types.insert(top_level_name(*field.enum_type()));
    found.files.insert(field.enum_type()->file());
    if (field.enum_type()->containing_type())
      visit(*field.enum_type()->containing_type(), seen, found);
  }
}

template <typename TypeProto>
void keep_reachable(pb::RepeatedPtrField<TypeProto>& types, const std::string& package,
                    const Reachable& found) {
  for (int i = types.size(); i-- > 0;) {
    const std::string prefix = package.empty() ? "" : package + ".";
    if (!found.types.contains(prefix + types[i].name())) types.DeleteSubrange(i, 1);
  }
}

void add_file(const pb::FileDescriptor& file, const Reachable& found,
              std::set<const pb::FileDescriptor*>& added, pb::FileDescriptorSet& set) {
  if (!found.files.contains(&file) || !added.insert(&file).second) return;
  pb::FileDescriptorProto proto;
  file.CopyTo(&proto);
  keep_reachable(*proto.mutable_message_type(), proto.package(), found);
  keep_reachable(*proto.mutable_enum_type(), proto.package(), found);
  proto.clear_service();
  proto.clear_extension();
  proto.clear_dependency();
  // No file of ours re-exports another's types.
  TROCAR_ASSERT(proto.public_dependency_size() == 0 && proto.weak_dependency_size() == 0);
  for (int i = 0; i < file.dependency_count(); ++i) {
    if (!found.files.contains(file.dependency(i))) continue;
    proto.add_dependency(std::string(file.dependency(i)->name()));
    add_file(*file.dependency(i), found, added, set);
  }
  *set.add_file() = std::move(proto);
}

}  // namespace

Bytes schema_bytes(const pb::Descriptor& message) {
  Reachable found;
  std::set<const pb::Descriptor*> seen;
  visit(message, seen, found);
  pb::FileDescriptorSet set;
  std::set<const pb::FileDescriptor*> added;
  add_file(*message.file(), found, added, set);
  Bytes bytes(set.ByteSizeLong());
  set.SerializeWithCachedSizesToArray(bytes.data());
  return bytes;
}

std::string schema_name(const pb::Descriptor& message) {
  return std::string(message.full_name());
}

}  // namespace trocar::journal
