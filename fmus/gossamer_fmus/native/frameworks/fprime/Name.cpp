// Written by gossamer flight; see {{Name}}.fpp.
#include "Gossamer/{{Name}}/{{Name}}.hpp"

namespace Gossamer {

{{Name}}::{{Name}}(const char* const name) : {{Name}}ComponentBase(name), m_component(), m_work(), m_begun(false), m_health(0U) {}

U32 {{Name}}::begin(const ::{{name}}_inputs& sample) {
  ::{{name}}_parameters p = ::{{name}}_start_parameters;
  Fw::ParamValid valid = Fw::ParamValid::INVALID;
  const {{real}} period = this->paramGet_PERIOD(valid);
{{get_parameters}}
  return ::{{name}}_init(&this->m_component, &p, period, &sample, &this->m_work);
}

void {{Name}}::sampleIn_handler(FwIndexType port, {{input_arguments}}, U32 sequence) {
  (void)port;
  ::{{name}}_inputs u = ::{{name}}_start_inputs;
  ::{{name}}_outputs y = {};
{{set_inputs}}
  u.sequence = sequence;
  ::{{name}}_seal(&u);
  if (this->m_begun) {
    (void)::{{name}}_step(&this->m_component, &u, &y, &this->m_work);
  } else {
    y.health = this->begin(u);
    this->m_begun = (y.health & ({{NAME}}_LOST | {{NAME}}_CONSTANTS)) == 0U;
    ::{{name}}_to_outputs(this->m_component.first.results, &y);
    y.sequence = sequence;
    if (this->m_begun) {
      this->log_ACTIVITY_HI_Began(sequence);
    }
  }
  if (y.health != this->m_health) {
    this->log_WARNING_HI_HealthChanged(y.health, sequence);
    this->m_health = y.health;
  }
  this->tlmWrite_health(y.health);
{{set_results}}
  if (this->isConnected_resultOut_OutputPort(0)) {
    this->resultOut_out(0, {{result_values}}, y.sequence, y.health);
  }
}

void {{Name}}::BEGIN_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) {
  this->m_begun = false;
  this->cmdResponse_out(opCode, cmdSeq, Fw::CmdResponse::OK);
}

}  // namespace Gossamer
