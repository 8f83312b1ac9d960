// SPDX-License-Identifier: Apache-2.0
#include "diorama/annotator.h"

namespace diorama {

Annotator::~Annotator() = default;

void Annotator::annotate(const Scene& scene, Frame& frame) const {
  const NameSet provided = provides();
  const NameSet before = frame.channels();
  Frame::Access access{needs(), provided};
  access.readable.insert(provided.begin(), provided.end());
  struct Lent {
    Frame& frame;
    Lent(Frame& lent, const Frame::Access& access) : frame(lent) { frame.access_ = &access; }
    ~Lent() { frame.access_ = nullptr; }
  };
  {
    const Lent lent(frame, access);
    do_annotate(scene, frame);
  }
  for (const std::string& name : provided) {
    if (!is_annotation(name)) frame.check_channel(name);
  }
  // Whoever assigns another frame removes channels without setting any.
  for (const std::string& name : before) frame.image_named(name);
}

}  // namespace diorama
