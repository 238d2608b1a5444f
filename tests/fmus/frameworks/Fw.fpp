# What a component needs of F Prime's Fw, by its public names; the types are left abstract.
type FwOpcodeType = U32
type FwEventIdType = U32
type FwChanIdType = U32
type FwPrmIdType = U32

module Fw {
  type CmdArgBuffer
  type LogBuffer
  type ParamBuffer
  type TextLogString
  type Time
  type TlmBuffer
  enum CmdResponse: U8 { OK = 0, INVALID_OPCODE = 1, VALIDATION_ERROR = 2, FORMAT_ERROR = 3, EXECUTION_ERROR = 4, BUSY = 5 }
  enum LogSeverity { FATAL = 1, WARNING_HI = 2, WARNING_LO = 3, COMMAND = 4, ACTIVITY_HI = 5, ACTIVITY_LO = 6, DIAGNOSTIC = 7 }
  enum ParamValid { UNINIT = 0, VALID = 1, INVALID = 2, DEFAULT = 3 }
  port Cmd(opCode: FwOpcodeType, cmdSeq: U32, ref args: CmdArgBuffer)
  port CmdReg(opCode: FwOpcodeType)
  port CmdResponse(opCode: FwOpcodeType, cmdSeq: U32, $response: CmdResponse)
  port Log($id: FwEventIdType, ref timeTag: Fw.Time, $severity: LogSeverity, ref args: LogBuffer)
  port LogText($id: FwEventIdType, ref timeTag: Fw.Time, $severity: LogSeverity, ref $text: TextLogString)
  port PrmGet($id: FwPrmIdType, ref val: ParamBuffer) -> ParamValid
  port PrmSet($id: FwPrmIdType, ref val: ParamBuffer)
  port Time(ref $time: Fw.Time)
  port Tlm($id: FwChanIdType, ref timeTag: Fw.Time, ref val: TlmBuffer)
}
