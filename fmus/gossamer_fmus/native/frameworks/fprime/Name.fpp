# {{description}}. Written by gossamer flight from the model's table of variables; ranges are those of INTERFACE.md.
module Gossamer {
{{arrays}}
  @ A sample with its number: one more each period, also where a sample is lost
  port {{Name}}Sample(
{{inputs}}
    $sequence: U32
  )

  @ What a sample gave; with health & {{NAME}}_INVALID ({{name}}.h) it must not be used
  port {{Name}}Result(
{{results}}
    $sequence: U32 @< of the last sample that was used
    $health: U32
  )

  @ {{description}}
  passive component {{Name}} {

    @ A sample in, as soon as it is measured
    guarded input port sampleIn: {{Name}}Sample

    @ Its results out, before sampleIn returns
    output port resultOut: {{Name}}Result

    @ Begin again with the next sample and the present parameters: where the state was lost, and the strain is known
    guarded command BEGIN opcode 0x00

    @ The state began with a sample
    event Began($sequence: U32) severity activity high id 0x00 format "began with sample {}"

    @ Health is another one than before: {{NAME}}_REFUSED and others of {{name}}.h, one bit each
    event HealthChanged($health: U32, $sequence: U32) severity warning high id 0x01 format "health 0x{x} at sample {}"

    @ Health of the last step
    telemetry $health: U32 id 0x00 update on change format "0x{x}"

{{telemetry}}
    @ Time between samples [s]
    param PERIOD: {{real}} default {{period}} id 0x00 set opcode 0x40 save opcode 0x80

{{parameters}}
    command recv port cmdIn
    command reg port cmdRegOut
    command resp port cmdResponseOut
    event port eventOut
    text event port textEventOut
    telemetry port tlmOut
    time get port timeCaller
    param get port prmGetOut
    param set port prmSetOut
  }
}
