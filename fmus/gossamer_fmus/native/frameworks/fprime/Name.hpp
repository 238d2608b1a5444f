// Written by gossamer flight; see {{Name}}.fpp.
#ifndef GOSSAMER_{{NAME}}_HPP
#define GOSSAMER_{{NAME}}_HPP

#include "Gossamer/{{Name}}/{{Name}}ComponentAc.hpp"

#include "{{name}}.h"

namespace Gossamer {

class {{Name}} : public {{Name}}ComponentBase {
 public:
  explicit {{Name}}(const char* name);

 private:
  void sampleIn_handler(FwIndexType port, {{input_arguments}}, U32 sequence) override;
  void BEGIN_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) override;
  U32 begin(const ::{{name}}_inputs& sample);

  ::{{name}} m_component;
  ::{{name}}_work m_work;
  bool m_begun;
  U32 m_health;
};

}  // namespace Gossamer

#endif
